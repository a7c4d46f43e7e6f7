"""The five-link biped: its mechanics by independent laws, its gait against the reference."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from collocation.examples import example
from trajopt import Status
from trajopt import collocation as col

model = example("_biped_model")
SIDES = ("hip", "shoulder")


def cross(a: Any, b: Any) -> Any:
    return a[0] * b[1] - a[1] * b[0]


def centers(biped: Any, q: Any) -> Any:
    """Centers of mass by walking along the chain, from lengths alone."""
    foot, knee, hip, shoulder, swing_knee, swing_foot = biped.points(q)
    d = model.CENTER
    torso = hip + (shoulder - hip) * d[2] / 0.625
    if biped is BIPEDS["shoulder"]:
        torso = shoulder + (hip - shoulder) * d[2] / 0.625
    return np.array(
        [
            knee + (foot - knee) * d[0] / 0.4,
            hip + (knee - hip) * d[1] / 0.4,
            torso,
            hip + (swing_knee - hip) * d[3] / 0.4,
            swing_knee + (swing_foot - swing_knee) * d[4] / 0.4,
        ]
    )


BIPEDS = {side: model.Biped(side) for side in SIDES}


def motion(biped: Any, q: Any, rates: Any, d: float = 1e-6) -> Any:
    """Velocities of the centers of mass, by central differences."""
    return (centers(biped, q + d * rates) - centers(biped, q - d * rates)) / (2 * d)


@pytest.fixture(params=range(4))
def random(request: pytest.FixtureRequest) -> np.random.Generator:
    return np.random.default_rng(request.param)


@pytest.mark.parametrize("side", SIDES)
def test_energy_is_that_of_the_links(side: str, random: np.random.Generator) -> None:
    biped, q, rates = BIPEDS[side], random.normal(size=5), random.normal(size=5)
    speeds = motion(biped, q, rates)
    kinetic = 0.5 * np.sum(model.MASS * np.sum(speeds**2, axis=1)) + 0.5 * np.sum(
        model.INERTIA * rates**2
    )
    height = model.GRAVITY * model.MASS @ centers(biped, q)[:, 1]
    assert biped.energy(q, rates) == pytest.approx(kinetic + height, rel=1e-8)


@pytest.mark.parametrize("side", SIDES)
def test_energy_is_conserved_without_torque(side: str, random: np.random.Generator) -> None:
    biped = BIPEDS[side]
    y = np.concatenate([0.5 * random.normal(size=5), random.normal(size=5)])

    def slope(y: Any) -> Any:
        return np.concatenate([y[5:], biped.acceleration(y[:5], y[5:], np.zeros(5))])

    start, h = biped.energy(y[:5], y[5:]), 5e-4
    for _ in range(800):
        k1 = slope(y)
        k2 = slope(y + h / 2 * k1)
        k3 = slope(y + h / 2 * k2)
        k4 = slope(y + h * k3)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    assert biped.energy(y[:5], y[5:]) == pytest.approx(start, rel=1e-8)


@pytest.mark.parametrize("side", SIDES)
def test_power_of_the_torques_is_the_gain_of_energy(side: str, random: np.random.Generator) -> None:
    biped = BIPEDS[side]
    q, rates, torques = random.normal(size=5), random.normal(size=5), random.normal(size=5)
    acceleration, d = biped.acceleration(q, rates, torques), 1e-6
    gain = (
        biped.energy(q + d * rates, rates + d * acceleration)
        - biped.energy(q - d * rates, rates - d * acceleration)
    ) / (2 * d)
    # A torque acts on a link and against the one it hangs on.
    power = torques @ (rates - np.append(0.0, rates[:-1]))
    assert gain == pytest.approx(power, abs=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_angular_momentum_balance_about_every_joint(side: str, random: np.random.Generator) -> None:
    """(F.4) to (F.8), with q̈ in (F.4) and the right sum of (F.7) from 4."""
    biped = BIPEDS[side]
    q, rates, torques = random.normal(size=5), random.normal(size=5), random.normal(size=5)
    acceleration, d = biped.acceleration(q, rates, torques), 1e-4
    at = [centers(biped, q + s * d * rates + 0.5 * d**2 * acceleration) for s in (-1, 0, 1)]
    here = centers(biped, q)
    second = (at[0] - 2 * here + at[2]) / d**2
    joints = biped.points(q)
    for k, joint in enumerate((joints[0], joints[1], joints[2], joints[2], joints[4])):
        left, right = torques[k], 0.0
        for i in range(k, 5):
            arm = here[i] - joint
            left += cross(arm, [0.0, -model.MASS[i] * model.GRAVITY])
            right += cross(arm, model.MASS[i] * second[i]) + model.INERTIA[i] * acceleration[i]
        assert left == pytest.approx(right, abs=2e-5)


@pytest.mark.parametrize("side", SIDES)
def test_heel_strike_keeps_angular_momentum(side: str, random: np.random.Generator) -> None:
    """(F.11) to (F.15): about the new foot, and about every joint for the links beyond it."""
    biped, q, rates = BIPEDS[side], random.normal(size=5), random.normal(size=5)
    after, new = biped.heel_strike(q, rates)
    np.testing.assert_array_equal(after, q[::-1])
    old_joints, new_joints = biped.points(q), biped.points(after)
    for before_links, old, after_links, joint in (
        (range(5), 5, range(5), 0),
        (range(4), 4, range(1, 5), 1),
        (range(3), 2, range(2, 5), 2),
        (range(2), 2, range(3, 5), 2),
        (range(1), 1, range(4, 5), 4),
    ):
        found = []
        for links, angles, speeds, point in (
            (before_links, q, rates, old_joints[old]),
            (after_links, after, new, new_joints[joint]),
        ):
            where, moving = centers(biped, angles), motion(biped, angles, speeds)
            found.append(
                sum(
                    cross(where[i] - point, model.MASS[i] * moving[i])
                    + model.INERTIA[i] * speeds[i]
                    for i in links
                )
            )
        assert found[0] == pytest.approx(found[1], abs=1e-6)


def test_heel_strike_loses_energy() -> None:
    solution = col.solve(model.problem(), segments=10)
    biped, x = BIPEDS["hip"], solution.x
    assert biped.energy(x[0, :5], x[0, 5:]) < biped.energy(x[-1, :5], x[-1, 5:])


@pytest.mark.parametrize(("side", "expected"), [("hip", 390.79043694), ("shoulder", 469.501071)])
def test_gait(side: str, expected: float) -> None:
    solution = col.solve(model.problem(side), segments=25, tolerance=1e-10)
    assert solution.status is Status.SOLVED
    assert solution.objective == pytest.approx(expected, abs=1e-6)
    biped, x = BIPEDS[side], solution.x
    angles, rates = biped.heel_strike(x[-1, :5], x[-1, 5:])
    np.testing.assert_allclose(x[0], np.concatenate([angles, rates]), atol=1e-8)
    np.testing.assert_allclose(biped.points(x[-1, :5])[5], [0.5, 0.0], atol=1e-8)
    # The foot leaves, swings above the ground, and comes down (7.4), (7.5).
    feet = np.array([biped.points(row[:5])[5] for row in solution.state(np.linspace(0, 0.7, 141))])
    assert feet[1:-1, 1].min() > 0
    assert biped.foot_rise(x[0, :5], x[0, 5:]) > 0 > biped.foot_rise(x[-1, :5], x[-1, 5:])


@pytest.mark.parametrize(("side", "expected"), [("hip", 392.88909), ("shoulder", 456.18898)])
def test_the_other_gait(side: str, expected: float) -> None:
    """From no torque at all the solver finds another local optimum; for one side a better one."""
    solution = col.solve(model.problem(side, knee_torque=0.0), segments=25)
    assert solution.objective == pytest.approx(expected, abs=1e-4)


def test_the_foot_clears_what_it_has_to() -> None:
    """(7.6), a height over time, changes the gait; (7.7), one over the way, does not."""
    biped = BIPEDS["hip"]

    def above(height: Any) -> Any:
        def room(t: Any, x: Any, u: Any) -> list[Any]:
            foot = biped.points(x[:5])[5]
            return [foot[1] - height(t, foot[0])]

        return room, 0.0, None

    def walk(height: Any) -> col.Solution:
        problem = replace(model.problem(), path=above(height))
        return col.solve(problem, segments=25, solver="native")

    over_time = walk(lambda t, x: 0.1 * np.sin(np.pi * t / 0.7))
    assert over_time.status is Status.SOLVED
    assert over_time.objective == pytest.approx(394.98282, abs=1e-4)
    heights = np.array([biped.points(row[:5])[5][1] for row in over_time.x])
    assert (heights - 0.1 * np.sin(np.pi * over_time.t / 0.7)).min() > -1e-7
    over_way = walk(lambda t, x: 0.05 * (1 - (x / 0.5) ** 2))
    assert over_way.objective == pytest.approx(390.79043694, abs=1e-5)


def test_coarse_to_fine() -> None:
    """Kelly 7.6: 5 segments, then 25."""
    solution = col.solve(model.problem(), refine=[{"segments": 5, "tolerance": 1e-3}, 25])
    assert solution.objective == pytest.approx(390.79043694, abs=1e-5)


def test_derivatives() -> None:
    assert all(check.agrees for check in col.check_derivatives(model.problem(), samples=2))
