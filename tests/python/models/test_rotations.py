"""Rotation vectors against scipy, and the identities between the functions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trajopt import rotations as rot

angles = st.floats(-6, 6, allow_nan=False)
vectors = st.tuples(angles, angles, angles).map(np.array)
sizes = st.sampled_from([0.0, 1e-12, 1e-8, 1e-4, 9.9e-3, 1.01e-2, 1.0])


@given(vectors, sizes)
def test_exp_equals_scipy(r, size):
    np.testing.assert_allclose(
        rot.exp(size * r), Rotation.from_rotvec(size * r).as_matrix(), atol=1e-14
    )


@given(vectors, sizes)
def test_log_inverts_exp(r, size):
    matrix = rot.exp(size * r)
    np.testing.assert_allclose(rot.exp(rot.log(matrix)), matrix, atol=1e-13)


@given(vectors, sizes)
def test_quaternions(r, size):
    q = rot.to_quaternion(size * r)
    assert np.linalg.norm(q) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(rot.matrix_from_quaternion(q), rot.exp(size * r), atol=1e-14)
    np.testing.assert_allclose(rot.exp(rot.from_quaternion(q)), rot.exp(size * r), atol=1e-13)


@given(vectors, vectors)
def test_left_jacobian_is_the_derivative_of_exp(r, direction):
    h = 1e-6
    change = rot.exp(r + h * direction) @ rot.exp(r - h * direction).T
    np.testing.assert_allclose(
        rot.log(change) / (2 * h), rot.left_jacobian(r) @ direction, atol=1e-7
    )


@given(vectors, sizes)
def test_left_jacobian_inverse(r, size):
    r = size * r / 4  # inside the first singularity
    product = rot.left_jacobian_inverse(r) @ rot.left_jacobian(r)
    np.testing.assert_allclose(product, np.eye(3), atol=1e-11)


@given(vectors, vectors)
def test_nearest_is_the_same_rotation_and_no_farther(r, reference):
    near = rot.nearest(r, reference)
    np.testing.assert_allclose(rot.exp(near), rot.exp(r), atol=1e-12)
    axis = r / np.linalg.norm(r) if np.linalg.norm(r) > 1e-12 else np.zeros(3)
    distance = np.linalg.norm(near - reference)
    for turn in (-2, -1, 0, 1, 2):
        other = near + 2 * np.pi * turn * axis
        assert distance <= np.linalg.norm(other - reference) + 1e-9


def test_nearest_follows_a_spin():
    reference = np.array([0.0, 0, 0])
    for angle in np.arange(0, 20, 0.1):
        r = rot.log(rot.exp([0, angle, 0]))
        reference = rot.nearest(r, reference)
        np.testing.assert_allclose(reference, [0, angle, 0], atol=1e-9)


def test_nearest_of_the_identity_takes_the_axis_of_the_reference():
    np.testing.assert_allclose(rot.nearest([0, 0, 0], [0, 6, 0]), [0, 2 * np.pi, 0])


@pytest.mark.parametrize("speed", [0.01, -0.31])
@pytest.mark.parametrize("count", [0, 1, 2, 64, 65, 66, 200])
def test_unwrap_is_nearest_frame_by_frame(speed, count):
    angle = 0.4 + speed * np.arange(count)  # within half a turn, and through many
    axis = np.array([0.36, 0.48, 0.8])
    r = rot.log(rot.exp(angle[:, None] * axis)) if count else np.zeros((0, 3))
    expected = r.copy()
    for i in range(1, count):
        expected[i] = rot.nearest(expected[i], expected[i - 1])
    unwrapped = rot.unwrap(r)
    np.testing.assert_array_equal(unwrapped, expected)
    np.testing.assert_allclose(unwrapped, angle[:, None] * axis, atol=1e-9)


def test_unwrap_goes_on_from_a_turn_in_an_earlier_block():
    angle = np.concatenate([np.linspace(0, 8, 64), np.full(100, 8.0)])
    r = rot.log(rot.exp(angle[:, None] * [0, 0, 1]))
    np.testing.assert_allclose(rot.unwrap(r)[:, 2], angle, atol=1e-12)


def test_leading_axes():
    r = np.random.default_rng(0).normal(size=(2, 3, 3))
    assert rot.exp(r).shape == (2, 3, 3, 3)
    assert rot.log(rot.exp(r)).shape == r.shape
    assert rot.to_quaternion(r).shape == (2, 3, 4)
    assert rot.left_jacobian_inverse(r).shape == (2, 3, 3, 3)
