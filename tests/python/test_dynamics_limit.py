"""As dt goes to 0 the residual becomes M(q)q̈ + C(q, q̇)q̇ + g(q), at the order of its scheme."""

from __future__ import annotations

import numpy as np
import pytest

from oracles.characters import (
    CENTRED,
    CHARACTERS,
    INTEGRATORS,
    arguments,
    character,
    core,
    physics,
)
from oracles.inverse_dynamics import Curve, mujoco_force, pinocchio_force
from oracles.reference import Law

STEPS = [1.6e-2, 8e-3, 4e-3]  # finer ones would see the six digits of numbers in MJCF text
FLIGHT = {"ground": False, "limit": 0.0, "self_collision": 0.0}


def curve_of(name):
    rng = np.random.default_rng(4)
    model = character(name)
    x = model.home + 0.3 * rng.normal(size=model.ndof)
    return Curve(x, rng.normal(size=model.ndof), 3.0 * rng.normal(size=model.ndof))


def residual(name, integrator, curve, dt):
    # The time of the frame whose directions test the inertia is 0.
    first = 0.0 if integrator == "implicit" else dt
    frames = [curve(first - k * dt)[None] for k in range(3)]
    law = physics(Law(integrator=integrator, **FLIGHT))
    return core(name).residual(*frames, np.full(1, dt), law)[0]


@pytest.mark.parametrize("oracle", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("name", CHARACTERS)
def test_slope(name, oracle):
    curve = curve_of(name)
    if oracle == "pinocchio":
        exact = pinocchio_force(arguments(name), curve)
    else:
        exact = mujoco_force(character(name).xml, curve)
    for integrator in INTEGRATORS:
        errors = [np.max(np.abs(residual(name, integrator, curve, dt) - exact)) for dt in STEPS]
        slopes = np.diff(np.log(errors)) / np.diff(np.log(STEPS))
        order = 2 if integrator in CENTRED else 1
        assert np.all(np.abs(slopes - order) < 0.1), (integrator, errors)
        assert errors[-1] < (2e-3 if order == 2 else 0.1) * np.max(np.abs(exact))


@pytest.mark.parametrize("name", CHARACTERS)
def test_oracles_agree(name):
    curve = curve_of(name)
    a, b = pinocchio_force(arguments(name), curve), mujoco_force(character(name).xml, curve)
    assert np.max(np.abs(a - b)) < 1e-5 * np.max(np.abs(a))
