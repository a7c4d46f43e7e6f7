"""Motions whose residual is known without any computation."""

from __future__ import annotations

import numpy as np
import pytest

from oracles.characters import CHARACTERS, INTEGRATORS, character, core, natural_law, physics


def rest(name, law):
    """The pose in which ground and weight balance, by descent from home with stiff joints."""
    x = character(name).home.copy()[None]
    x[0, 2] -= character(name).lowest_point(x[0]) + 0.02 * character(name).length
    for _ in range(300):
        force, *blocks = core(name).jacobians(x, x, x, np.ones(1), physics(law))
        curvature, axes = np.linalg.eigh(sum(blocks)[0, :6, :6])
        # Sliding and turning about the vertical are free: no force, no curvature, no step.
        floor = 1e-9 * np.max(np.abs(curvature))
        step = axes @ ((axes.T @ -force[0, :6]) / np.maximum(np.abs(curvature), floor))
        x[0, :6] += step * min(1.0, 0.02 / np.max(np.abs(step)))
    return x


@pytest.mark.parametrize("name", CHARACTERS)
def test_standing_still(name):
    """At rest no scheme, friction law or damping puts a force on the root."""
    x = rest(name, natural_law(name))
    weight = 9.81 * character(name).mass
    for integrator in INTEGRATORS:
        for coulomb in (False, True):
            for damping in (0.0, 1.0):
                law = natural_law(name, integrator=integrator, coulomb=coulomb, damping=damping)
                force = core(name).residual(x, x, x, np.full(1, 0.02), physics(law))[0, :6]
                assert np.max(np.abs(force)) < 1e-9 * weight


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", CHARACTERS)
def test_free_fall(name, integrator):
    """A parabola without rotation needs no force, exactly, at any time step."""
    model = character(name)
    law = physics(natural_law(name, integrator=integrator, ground=False, limit=0.0))
    for dt in (0.1, 0.01):
        frames = []
        for t in (0.0, -dt, -2.0 * dt):
            x = model.home.copy()
            x[:3] += np.array([0.3, -0.2, 1.0]) * t + 0.5 * t**2 * np.array([0.0, 0.0, -9.81])
            frames.append(x[None])
        force = core(name).residual(*frames, np.full(1, dt), law)[0]
        rounding = 1e-15 * model.mass / dt**2
        assert np.max(np.abs(force[:6])) < 10.0 * rounding


@pytest.mark.parametrize("name", CHARACTERS)
def test_gravity_off_and_still(name):
    """Without gravity and ground a resting character asks for nothing at all."""
    x = character(name).home[None]
    law = natural_law(name, gravity=(0.0, 0.0, 0.0), ground=False, limit=0.0, self_collision=0.0)
    force = core(name).residual(x, x, x, np.full(1, 0.02), physics(law))
    assert np.max(np.abs(force)) < 1e-11 * 9.81 * character(name).mass
