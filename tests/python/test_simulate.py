"""Forward simulation: order, energy, exact samples, torques, batches and bad input."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from oracles.characters import CENTRED, INTEGRATORS, character
from trajopt.simulate import SimulationError, simulate
from trajopt.world import Contact, World

CAPSULE = """<mujoco><worldbody><body name="capsule" pos="0 0 0.36"><freejoint/>
<geom type="capsule" size="0.06" fromto="-0.15 0 0 0.15 0 0" mass="0.3"/></body>
</worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def capsule(tmp_path_factory):
    path = tmp_path_factory.mktemp("capsule") / "capsule.xml"
    path.write_text(CAPSULE)
    return trajopt.load_model(path)


def distance(model, a, b):
    return np.max(np.sqrt(np.mean(model.difference(a, b) ** 2, axis=-1)))


@pytest.fixture(scope="module")
def tumbling():
    model = character("chain")
    speed = np.zeros(model.ndof)
    speed[3:6] = (2.0, 3.0, 1.0)
    speed[6:] = np.random.default_rng(0).normal(size=model.ndof - 6)
    exact = simulate(model, model.home, speed, 0.6, 0.05, substeps=200)
    return model, speed, exact.x


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_order_of_tumbling(tumbling, integrator):
    model, speed, exact = tumbling
    errors = [
        distance(
            model,
            exact,
            simulate(
                model, model.home, speed, 0.6, 0.05, integrator=integrator, substeps=substeps
            ).x,
        )
        for substeps in (2, 4, 8)
    ]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    if integrator in CENTRED:
        assert np.all(slopes > 1.9)
    else:
        assert np.all((slopes > 0.7) & (slopes < 1.2))


@pytest.mark.parametrize("integrator", ["verlet", "linear_acceleration", "trapezoidal"])
def test_bounce_keeps_energy(capsule, integrator):
    law, dt = Contact(normal=3e3, friction=0.0, damping=0.0), 0.0125
    x = simulate(capsule, capsule.home, np.zeros(6), 2.0, dt, contact=law, integrator=integrator).x
    z = x[:, 2]
    energy = 9.81 * (z[1:-1] - 0.06) + 0.5 * ((z[2:] - z[:-2]) / (2 * dt)) ** 2
    free = np.minimum(np.minimum(z[2:], z[1:-1]), z[:-2]) > 0.06
    assert np.count_nonzero(np.diff(free.astype(int)) == -1) >= 3
    assert abs(energy[free][-1] / energy[0] - 1.0) < 0.01


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_exact_samples_of_a_landing(integrator):
    """The true motion becomes feasible as dt falls: quickly for centred schemes."""
    model = character("chain")
    start = model.home.copy()
    start[2] += 0.5
    stiffness = 9.81 * model.mass / (6 * 0.028**2)
    law = Contact(normal=stiffness, friction=stiffness, damping=0.0)
    exact = simulate(model, start, np.zeros(model.ndof), 0.6, 0.00625, contact=law, substeps=32).x
    rms = []
    for stride in (2, 1):
        x = exact[::stride]
        force = model.dynamics_residual(
            x[2:], x[1:-1], x[:-2], 0.00625 * stride, contact=law, integrator=integrator
        )
        rms.append(np.sqrt(np.mean(force[:, :3] ** 2)))
    if integrator in CENTRED:
        assert rms[0] > 3.0 * rms[1]
    else:
        assert 1.5 * rms[1] < rms[0] < 2.5 * rms[1]
        assert rms[1] > 0.5 * 9.81 * model.mass


def test_torques_are_felt():
    """The residual of a driven motion is the torque that drove it."""
    model = character("biped")
    u = np.random.default_rng(1).normal(size=(10, model.nactuated))
    dt = 0.01
    run = simulate(model, model.home, np.zeros(model.ndof), 0.1, dt, control=u)
    x = np.concatenate([run.before[None], run.x])
    force = model.dynamics_residual(x[2:], x[1:-1], x[:-2], dt)
    np.testing.assert_allclose(force[:, model.actuated], u, atol=1e-6)
    np.testing.assert_allclose(force[:, ~model.actuated], 0.0, atol=1e-6)


def test_feedback_and_batch():
    """Side by side equals one by one, with a controller that sees every motion."""
    model = character("mammal")
    start = model.home + 0.1 * np.random.default_rng(2).normal(size=(3, model.ndof))
    start[:, 2] += 1.0

    def hold(t, x, v):
        return -20.0 * (x - model.home)[..., model.actuated] - v[..., model.actuated]

    settings = {"contact": Contact(normal=2e4), "control": hold}
    together = simulate(model, start, np.zeros(model.ndof), 0.2, 0.01, **settings)
    assert together.x.shape == (3, 21, model.ndof)
    for k in range(3):
        alone = simulate(model, start[k], np.zeros(model.ndof), 0.2, 0.01, **settings)
        np.testing.assert_allclose(alone.x, together.x[k], atol=1e-9)


def test_somersaults(capsule):
    """Many turns: the rotation vector wraps, the motion does not notice."""
    speed = np.array([0.0, 0.0, 0.0, 0.0, 20.0, 0.0])
    run = simulate(capsule, capsule.home, speed, 1.0, 0.01, world=World([], gravity=(0, 0, 0)))
    turned = run.x[-1, 3:]
    assert np.max(np.linalg.norm(run.x[:, 3:], axis=1)) <= np.pi + 1e-9
    expected = np.array([0.0, 20.0 - 6.0 * np.pi, 0.0])
    np.testing.assert_allclose(turned, expected, atol=0.05)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"dt": 0.0}, "dt"),
        ({"duration": float("nan")}, "duration"),
        ({"substeps": 0}, "substeps"),
        ({"x0": np.zeros(5)}, "x0"),
        ({"control": np.zeros(3)}, "control"),
    ],
)
def test_bad_arguments(change, word):
    model = character("chain")
    arguments = {"x0": model.home, "v0": np.zeros(model.ndof), "duration": 1.0, "dt": 0.1, **change}
    if word == "x0":
        arguments["v0"] = np.zeros(5)
    with pytest.raises(trajopt.ArgumentError, match=word):
        simulate(model, **arguments)


def test_a_step_without_solution_is_named():
    """A spin so fast that Pan's implicit step has no solution near its start."""
    model = character("chain")
    speed = np.zeros(model.ndof)
    speed[3:] = 30.0
    with pytest.raises(SimulationError, match=r"step of 0\.1 s \(implicit\)"):
        simulate(model, model.home, speed, 1.0, 0.1, integrator="implicit")
