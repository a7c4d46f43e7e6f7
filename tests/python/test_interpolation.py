"""The C² interpolant: through the frames, smooth, fourth order, any number of turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trajopt
from oracles.characters import character
from trajopt.interpolation import Interpolant


def tumble(model, t):
    """Smooth motion with a root that turns twice over."""
    t = np.asarray(t)[..., None]
    x = np.sin(t + np.arange(model.ndof))
    roll = Rotation.from_rotvec(np.reshape(t, (-1, 1)) * [6.0, 0.0, 0.0])
    pitch = Rotation.from_rotvec(np.sin(3.0 * np.reshape(t, (-1, 1))) * [0.0, 1.0, 0.0])
    x[..., 3:6] = (roll * pitch).as_rotvec().reshape(*t.shape[:-1], 3)
    return x


@pytest.fixture(scope="module")
def model():
    return character("chain")


def test_passes_through_unequal_frames(model):
    times = np.cumsum(np.random.default_rng(0).uniform(0.02, 0.06, size=50))
    x = tumble(model, times)
    motion = Interpolant(model, times, x)
    assert np.max(np.abs(model.difference(x, motion(times)))) < 1e-12


def test_fourth_order(model):
    t = np.linspace(0.5, 1.5, 301)
    errors = []
    for count in (40, 80, 160):
        times = np.linspace(0.0, 2.0, count + 1)
        motion = Interpolant(model, times, tumble(model, times))
        errors.append(np.max(np.abs(model.difference(tumble(model, t), motion(t)))))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.8)


def test_velocity_and_smoothness(model):
    """Velocity is the slope; velocity and acceleration do not jump at a frame."""
    times = np.linspace(0.0, 2.0, 41)
    motion = Interpolant(model, times, tumble(model, times))
    h, t = 1e-5, np.linspace(0.1, 1.9, 97)
    slope = model.difference(motion(t - h), motion(t + h)) / (2 * h)
    np.testing.assert_allclose(motion.velocity(t), slope, atol=1e-8)
    knots = times[5:-5]
    before = (motion.velocity(knots) - motion.velocity(knots - h)) / h
    after = (motion.velocity(knots + h) - motion.velocity(knots)) / h
    np.testing.assert_allclose(before, after, atol=0.05)
    assert np.max(np.abs(after)) > 5.0


@pytest.mark.parametrize("times", [[0.0], [0.0, 0.0], [1.0, 0.5], [[0.0, 1.0]]])
def test_bad_times(model, times):
    with pytest.raises(trajopt.ArgumentError, match="times"):
        Interpolant(model, times, np.zeros((2, model.ndof)))


def test_bad_shape(model):
    with pytest.raises(trajopt.ArgumentError, match="shape"):
        Interpolant(model, [0.0, 1.0], np.zeros((3, model.ndof)))
