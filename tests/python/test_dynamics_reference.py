"""The oracle itself: a wrong oracle would agree with a wrong core only by accident, but check."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from oracles.reference import Reference, exponential, point_masses
from oracles.trees import random_frames, random_tree


@pytest.mark.parametrize("count", [6, 50])
def test_point_masses_have_the_pseudo_inertia(count):
    cloud = np.vstack([np.random.default_rng(0).normal(size=(3, 9)), np.ones(9)])
    moment = cloud @ cloud.T
    mass, place = point_masses(moment, count)
    homogeneous = np.column_stack([place, np.ones(len(place))])
    np.testing.assert_allclose((homogeneous * mass[:, None]).T @ homogeneous, moment, rtol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.14159, 5.0])
def test_exponential_is_a_rotation(angle):
    r = angle * np.array([0.6, 0.0, -0.8])
    np.testing.assert_allclose(exponential(r)[0], Rotation.from_rotvec(r).as_matrix(), atol=4e-15)


@pytest.mark.parametrize("seed", range(4))
def test_product_rule_is_the_complex_step(seed):
    tree = Reference(random_tree(seed, 9, floating=seed % 2 == 0))
    x = random_frames(seed, tree.ndof, 1)[0][0]
    slope = tree.transforms(x)[1]
    for j in range(tree.ndof):
        nudged = x.astype(complex)
        nudged[j] += 1e-30j
        stepped = tree.transforms(nudged)[0].imag / 1e-30
        np.testing.assert_allclose(stepped, slope[:, j], atol=1e-14)
