"""The residual against brute-force quadrature of the paper's equation 5 over body points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oracles.characters import (
    CHARACTERS,
    INTEGRATORS,
    core,
    natural_law,
    physics,
    reference,
    states,
)
from oracles.reference import Law, Reference
from oracles.trees import random_frames, random_tree
from trajopt import _core

TOLERANCE = 1e-12  # of the largest generalized force; the project promises 1e-9


def relative(a, b):
    return np.max(np.abs(a - b)) / np.max(np.abs(b))


@pytest.mark.parametrize("touching", [True, False], ids=["contact", "flight"])
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", CHARACTERS)
def test_characters(name, integrator, touching):
    dt = 0.02
    for coulomb, damping, count in [(False, 0.0, 6), (False, 1.0, 30), (True, 1.0, 6)]:
        law = natural_law(name, integrator=integrator, coulomb=coulomb, damping=damping)
        frames = states(name, 10, dt, seed=1, touching=touching)
        expected = reference(name, count).residual(*frames, dt, law)
        got = core(name).residual(*frames, np.full(10, dt), physics(law))
        assert relative(got, expected) < TOLERANCE


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    floating=st.booleans(),
    integrator=st.sampled_from(INTEGRATORS),
    coulomb=st.booleans(),
    damping=st.sampled_from([0.0, 1.0]),
    friction=st.sampled_from([0.0, 3e3, 3e5]),
    steps=st.tuples(st.floats(0.005, 0.05), st.floats(0.005, 0.05)),
    tilt=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)
def test_random_trees(seed, floating, integrator, coulomb, damping, friction, steps, tilt):
    """Any joints, slopes, gravity directions and unequal steps."""
    normal = np.array([*tilt, 1.0]) / np.linalg.norm([*tilt, 1.0])
    law = Law(
        gravity=(0.5, -1.0, -9.0),
        plane_normal=tuple(normal),
        plane_offset=0.1,
        friction=friction,
        damping=damping,
        coulomb=coulomb,
        integrator=integrator,
    )
    arguments = random_tree(seed, 8, floating)
    tree = Reference(arguments)
    frames = random_frames(seed, tree.ndof, 2)
    expected = tree.residual(*frames, steps, law)
    got = _core.Model(**arguments).residual(
        *frames, np.full(2, steps[0]), physics(law), dt_before=np.full(2, steps[1])
    )
    assert relative(got, expected) < TOLERANCE


@pytest.mark.parametrize("name", CHARACTERS)
def test_states_do_touch(name):
    """The test above tests contact only if contact weighs in."""
    frames = states(name, 10, 0.02, seed=1, touching=True)
    law = natural_law(name)
    oracle = reference(name)
    with_ground = oracle.residual(*frames, 0.02, law)
    without = oracle.residual(*frames, 0.02, natural_law(name, ground=False))
    assert np.all(np.max(np.abs(with_ground - without), axis=1) > 1e-3 * np.max(np.abs(without)))
