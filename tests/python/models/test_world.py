"""World, plane and contact law: validation and defaults."""

import numpy as np
import pytest

from trajopt import ArgumentError, ArgumentTypeError, Contact, Plane, World
from trajopt.models import load_model


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane(normal=(0, 0, 0)), "zero vector"),
        (lambda: Plane(normal=(0, 0)), r"normal has shape \(2,\), expected \(3,\)"),
        (lambda: Plane(normal=(0, 0, np.nan)), r"normal\[2\] = nan, expected finite numbers"),
        (lambda: Plane(offset=np.inf), "offset must be finite"),
        (lambda: World([Plane(), Plane()]), "at most one Plane, not 2"),
        (lambda: World(gravity=(0, 0, np.nan)), "gravity"),
        (lambda: Contact(normal=-1.0), "normal must be >= 0, not -1.0"),
        (lambda: Contact(friction=np.nan), "friction must be finite"),
        (lambda: Contact(damping=-0.1), "damping"),
        (lambda: Contact(mu=-0.1), "mu must be"),
        (lambda: Contact(slip_velocity=0.0), "slip_velocity must be > 0, not 0.0"),
        (lambda: Contact(model="sticky"), "model must be smooth or coulomb"),
    ],
)
def test_bad_values(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane(normal="up"), "normal must be an array of numbers"),
        (lambda: Plane(offset="low"), "offset must be a number, not str"),
        (lambda: Contact(normal="hard"), "normal must be a number"),
        (lambda: Contact(mu=True), "mu must be a number, not bool"),
        (lambda: World(Plane()), r"World\(\[Plane\(\)\]\)"),
        (lambda: World(["box"]), r"obstacles\[0\] is a str"),
        (lambda: World(3), "must be a list of Plane, not int"),
    ],
)
def test_bad_types(make, message):
    with pytest.raises(ArgumentTypeError, match=message):
        make()


def test_plane_is_normalized():
    assert Plane((0, 3, 4)).normal == pytest.approx((0, 0.6, 0.8))


def test_equal_worlds_are_equal():
    assert World([Plane()]) == World()
    assert hash(World([Plane()])) == hash(World())


@pytest.mark.parametrize("name", ["chain", "biped", "humanoid"])
def test_default_contact_scales_with_the_model(name):
    model = load_model(name)
    law = Contact().resolved(model)
    depth = np.sqrt(model.mass * 9.81 / (len(model.support_points) * law.normal))
    assert depth == pytest.approx(0.008 * model.length)
    # Half the normal force at 2.5 % of the model's own speed.
    assert law.friction / law.normal * 0.025 * np.sqrt(9.81 * model.length) == pytest.approx(0.5)


def test_given_parameters_stay():
    law = Contact(1e4, 2e4, 0.0, "coulomb", 0.5, 0.01).resolved(load_model("chain"))
    assert (law.normal, law.friction, law.damping) == (1e4, 2e4, 0.0)
    assert (law.model, law.mu, law.slip_velocity) == ("coulomb", 0.5, 0.01)
