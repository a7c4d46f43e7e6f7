"""Audit of motions whose faults are known: none, hovering, sliding, sinking in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import trajopt
from oracles.characters import character
from trajopt.audit import (
    audit,
    contact_state,
    count_changes,
    fine_violation,
    flights,
    replay_drift,
    residual_work,
)
from trajopt.simulate import simulate
from trajopt.world import Contact, World


@dataclass
class Frames:
    """The attributes of a solution that an audit looks at."""

    model: Any
    x: Any
    times: Any
    dt: float
    initial: Any
    world: Any = None
    contact: Any = None
    integrator: str = "linear_acceleration"

    @property
    def frame_violation(self):
        x = np.concatenate([self.initial[::-1], self.x])
        force = self.model.dynamics_residual(
            x[2:], x[1:-1], x[:-2], self.dt, self.world, self.contact, self.integrator
        )
        return np.max(np.abs(force[:, ~self.model.actuated]), axis=1)


def sampled(model, path, dt, count, **settings):
    """Frames 1 to `count` of x = path(t)."""
    x = np.array([path(k * dt) for k in range(-1, count + 1)])
    return Frames(model, x[2:], dt * np.arange(1, count + 1), dt, x[1::-1], **settings)


def landing(dt, substeps=1, integrator="linear_acceleration"):
    """The chain falls a little, lands and bounces; a true motion where the steps are small."""
    model = character("chain")
    start = model.home.copy()
    start[2] += 0.1
    stiffness = 9.81 * model.mass / (6 * 0.028**2)
    run = simulate(
        model,
        start,
        np.zeros(model.ndof),
        0.5,
        dt,
        contact=Contact(normal=stiffness, friction=stiffness, damping=0.5),
        integrator=integrator,
        substeps=substeps,
    )
    # With substeps the frame before is not a frame; a fall from rest mirrors itself in time.
    before = run.before if substeps == 1 else run.x[1]
    return Frames(
        model,
        run.x[1:],
        run.times[1:],
        dt,
        np.stack([run.x[0], before]),
        contact=Contact(normal=stiffness, friction=stiffness, damping=0.5),
        integrator=integrator,
    )


def parabola(model, lift=0.0):
    """Free fall, or with `lift` = 1 none at all: a hand of god that carries the weight."""
    up = 9.81 * (1.0 - lift)

    def path(t):
        x = model.home.copy()
        x[:3] += np.array([0.5, 0.0, 1.0]) * t + 0.5 * t**2 * np.array([0.0, 0.0, -up])
        x[2] += 5.0
        return x

    return path


def test_free_fall_is_clean():
    model = character("mammal")
    motion = sampled(model, parabola(model), 0.025, 24, contact=Contact())
    assert fine_violation(motion).shape == (96,)
    assert np.max(fine_violation(motion)) < 1e-6 * 9.81 * model.mass
    assert replay_drift(motion).max < 1e-8
    gained, lost = residual_work(motion)
    assert gained < 1e-6
    assert lost > -1e-6
    state = contact_state(motion)
    assert flights(state) == [(0.0, pytest.approx(0.6))]
    assert not np.any(state.loaded)


def test_hovering_is_seen():
    """All of the weight between the frames, a fall in the replay, and the work of lifting."""
    model = character("mammal")
    weight = 9.81 * model.mass
    motion = sampled(model, parabola(model, lift=1.0), 0.025, 24)
    np.testing.assert_allclose(fine_violation(motion), weight, rtol=1e-6)
    replay = replay_drift(motion)
    assert replay.rms == pytest.approx(0.5 * 9.81 * replay.duration**2, rel=1e-2)
    assert replay.duration == pytest.approx(0.25)
    assert len(replay.starts) == 15
    gained, lost = residual_work(motion)
    assert gained == pytest.approx(weight * 0.6, rel=1e-6)
    assert lost == pytest.approx(0.0, abs=1e-9)


def test_torque_is_chart_free():
    """A free body that spins ever faster about the vertical needs the same torque all the time."""
    model = character("chain")
    spin = 2.0

    def path(t):
        x = model.home.copy()
        x[6:] = 0.0
        angle = 0.5 * spin * t**2 + 2.0 * t
        x[5] = (angle + np.pi) % (2.0 * np.pi) - np.pi
        return x

    motion = sampled(model, path, 0.0125, 160, world=World([], gravity=(0.0, 0.0, 0.0)))
    torque = fine_violation(motion)[20:-20]
    np.testing.assert_allclose(torque, np.mean(torque), rtol=1e-3)


def test_error_of_a_true_landing_falls_with_dt():
    """Sampled finely, a simulated landing passes; the floor of the measure is second order."""
    rms = [
        np.sqrt(np.mean(fine_violation(landing(dt, substeps=round(dt / 5e-4))) ** 2))
        for dt in (0.016, 0.008, 0.004)
    ]
    assert rms[0] > 2.5 * rms[1] > 6.0 * rms[2]
    motion = landing(0.004, substeps=8)
    assert replay_drift(motion).max < 1e-3


def test_pans_scheme_is_found_out():
    """Its frames obey it to rounding; between them a fair part of the weight is missing."""
    centred, implicit = landing(0.01), landing(0.01, integrator="implicit")
    assert max(np.max(centred.frame_violation), np.max(implicit.frame_violation)) < 1e-5
    assert replay_drift(implicit).rms > 5.0 * replay_drift(centred).rms


def test_audit_is_a_table():
    motion = landing(0.005)
    result = audit(motion)
    assert result.body_weight == pytest.approx(9.81 * motion.model.mass)
    assert sum(makes for makes, _ in result.contact_changes.values()) >= 2
    assert 0.0 < result.penetration_rms <= result.penetration_max < 0.1
    assert result.flights[0][0] == 0.0
    assert result.limit_excess < 0.5
    assert result.to_dict()["replay_max"] == result.replay_max
    text = str(result)
    for part in ("between frames, rms", "contact of", "N·m"):
        assert part in text
    assert max(len(line) for line in text.splitlines()) <= 100


def test_only_bodies_that_touch_are_in_the_table():
    model = character("spider")
    standing = model.home.copy()
    standing[2] -= model.lowest_point(model.home) + 0.02
    law = Contact(normal=1e5, friction=2e5, damping=0.0)
    result = audit(sampled(model, lambda t: standing, 0.02, 20, contact=law))
    shown = [line for line in str(result).splitlines() if line.startswith("contact of")]
    assert 4 <= len(shown) < len(result.contact_share)
    assert all(line.endswith("0 made, 0 broken, 100 % of the time") for line in shown)
    model = character("mammal")
    falling = audit(sampled(model, parabola(model), 0.025, 12))
    assert "contact of" not in str(falling)
    assert str(falling).splitlines()[-2].split() == ["contact", "none"]


def test_slip_and_cone():
    """A foot that is dragged: slip is the speed, friction over normal force the law's ratio."""
    model = character("spider")
    law = Contact(normal=1e5, friction=2e5, damping=0.0)

    def path(t):
        x = model.home.copy()
        x[2] -= model.lowest_point(model.home) + 0.02
        x[0] += 0.3 * t
        return x

    state = contact_state(sampled(model, path, 0.02, 10, contact=law))
    assert np.any(state.loaded)
    assert state.slip_max == pytest.approx(0.3, rel=1e-6)
    assert state.slip_rms == pytest.approx(0.3, rel=1e-6)
    assert state.cone_max == pytest.approx(0.6, rel=1e-6)
    assert np.max(state.depth) == pytest.approx(0.02, rel=1e-6)


def test_trembling_load_is_one_step():
    load = np.array([0.0, 0.06, 0.04, 0.06, 0.02, 0.06, 0.0])
    assert count_changes(load, 1.0) == (1, 1)


@pytest.mark.parametrize("change", [{"duration": 0.0}, {"substeps": 0}, {"stride": 0}])
def test_bad_replay(change):
    model = character("mammal")
    motion = sampled(model, parabola(model), 0.025, 12)
    with pytest.raises(trajopt.ArgumentError):
        replay_drift(motion, **change)


def test_initial_frames_are_needed():
    model = character("mammal")
    motion = sampled(model, parabola(model), 0.025, 12)
    motion.initial = np.zeros((2, 0))
    with pytest.raises(trajopt.ArgumentError, match="initial"):
        fine_violation(motion)
