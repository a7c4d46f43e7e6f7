"""Analytic Jacobians against the complex step through the oracle and central differences."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from oracles.characters import (
    CHARACTERS,
    INTEGRATORS,
    core,
    natural_law,
    physics,
    reference,
    states,
)
from oracles.reference import Reference
from oracles.trees import random_frames, random_tree
from trajopt import _core

TOLERANCE = 1e-12  # of the largest entry of its block; the project promises 1e-10
COUNT = 50  # states in contact, and as many in flight
DT = 0.02

SETTINGS = [
    {"integrator": integrator, "coulomb": coulomb, "damping": damping}
    for integrator, coulomb, damping in itertools.product(INTEGRATORS, (False, True), (0.0, 1.0))
]


def largest(a):
    return np.max(np.abs(a), axis=(-2, -1))


@pytest.mark.parametrize("touching", [True, False], ids=["contact", "flight"])
@pytest.mark.parametrize("name", CHARACTERS)
def test_complex_step(name, touching):
    """Every scheme, friction law and damping at every state."""
    frames = states(name, COUNT, DT, seed=2, touching=touching)
    laws = [natural_law(name, **changes) for changes in SETTINGS]
    for n in range(COUNT):
        expected = reference(name).jacobians(*(q[n] for q in frames), DT, laws)
        for law, blocks in zip(laws, expected, strict=True):
            got = core(name).jacobians(
                *(q[n : n + 1] for q in frames), np.full(1, DT), physics(law)
            )
            for mine, exact in zip(got[1:], blocks, strict=True):
                assert largest(mine[0] - exact) < TOLERANCE * largest(exact), (n, law)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", CHARACTERS)
def test_central_differences(name, integrator):
    """The core against itself: its Jacobians belong to its residual."""
    law = physics(natural_law(name, integrator=integrator, damping=1.0))
    frames = states(name, 4, DT, seed=3, touching=True)
    dt = np.full(4, DT)
    exact = core(name).jacobians(*frames, dt, law)[1:]
    h = 1e-6
    for k, block in enumerate(exact):
        for j in range(block.shape[2]):
            ahead, behind = list(frames), list(frames)
            nudge = h * np.eye(block.shape[2])[j]
            ahead[k], behind[k] = frames[k] + nudge, frames[k] - nudge
            slope = core(name).residual(*ahead, dt, law) - core(name).residual(*behind, dt, law)
            assert np.max(np.abs(slope / (2 * h) - block[:, :, j])) < 1e-7 * np.max(largest(block))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_random_trees(seed, integrator):
    """Inner ball joints, fixed bases, massless links and unequal steps."""
    arguments = random_tree(seed, 9, floating=seed % 2 == 0)
    tree, steps = Reference(arguments), (0.012, 0.03)
    frames = random_frames(seed, tree.ndof, 2)
    law = natural_law("chain", integrator=integrator, coulomb=seed % 3 == 0, damping=1.0)
    got = _core.Model(**arguments).jacobians(
        *frames, np.full(2, steps[0]), physics(law), dt_before=np.full(2, steps[1])
    )
    for mine, exact in zip(got[1:], tree.jacobians(*frames, steps, [law])[0], strict=True):
        assert np.all(largest(mine - exact) < TOLERANCE * largest(exact))
