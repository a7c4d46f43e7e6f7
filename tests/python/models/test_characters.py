"""The built-in characters are complete, plausible, and stand where they say."""

import warnings

import mujoco
import numpy as np
import pytest

from trajopt.models import builtin_names, load_model
from trajopt.models.source import builtin_path

from .helpers import assert_same_kinematics

NAMES = ("biped", "bird", "chain", "humanoid", "mammal", "spider")
NDOF = {"biped": 14, "bird": 16, "chain": 14, "humanoid": 33, "mammal": 18, "spider": 18}
FEET = {"biped": 2, "bird": 2, "chain": 5, "humanoid": 4, "mammal": 4, "spider": 4}


def test_all_are_there():
    assert builtin_names() == NAMES


@pytest.fixture(params=NAMES)
def model(request):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a built-in gives no cause to warn
        return load_model(request.param)


def test_size(model):
    assert model.ndof == NDOF[model.name]
    assert model.nactuated == model.ndof - 6
    assert not model.actuated[:6].any()
    assert len(model.feet) == FEET[model.name]
    assert 0.5 <= model.mass <= 80
    assert 0.25 <= model.leg_length <= 1
    assert 0.5 <= model.length <= 1


def test_same_kinematics_as_in_mujoco(model):
    reference = mujoco.MjModel.from_xml_path(str(builtin_path(model.name)))
    assert_same_kinematics(model, reference)


def test_home_is_inside_the_limits(model):
    limited = np.isfinite(model.lower)
    assert limited.sum() == model.nactuated
    room = np.minimum(model.home - model.lower, model.upper - model.home)[limited]
    assert room.min() > 0.15


def test_home_stands_on_the_ground(model):
    """Feet touch within a millimetre and the centre of mass is above them."""
    assert abs(model.lowest_point(model.home)) < 1e-3
    support = model.contact_positions(model.home)[model.support_points]
    center = model.center_of_mass(model.home)
    assert (support[:, :2].min(axis=0) < center[:2]).all()
    assert (center[:2] < support[:, :2].max(axis=0)).all()


def test_home_collides_nowhere(model):
    centers = model.sphere_centers(model.home)
    a, b = model.sphere_pairs.T
    gap = np.linalg.norm(centers[a] - centers[b], axis=1)
    assert (gap > model.sphere_radius[a] + model.sphere_radius[b]).all()


def test_mirror_symmetry(model):
    """Left and right weigh the same: the centre of mass of a two-sided figure is in its plane."""
    if model.name != "chain":
        assert abs(model.center_of_mass(model.home)[1]) < 1e-12


def test_inertias_are_possible(model):
    for matrix in model.pseudo_inertia:
        assert np.linalg.eigvalsh(matrix).min() > -1e-12
