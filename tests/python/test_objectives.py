"""Every objective term against its formula in NumPy, and its gradient against differences."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt import objectives as terms
from trajopt.audit.motion import torque_rows
from trajopt.transcription import Stage, Transcription

STEPS = np.array([0.03, 0.03, 0.04, 0.05, 0.05, 0.04, 0.03, 0.03, 0.04, 0.06])
SHARE = STEPS / STEPS.sum()
EVEN = np.full(10, 0.04)
CONTACT = trajopt.Contact(normal=2e4, friction=3e4, damping=0.4)


class Scene:
    """A chain that slides over the ground in a random motion, and the values of its terms."""

    def __init__(self, *added, steps=STEPS, formulation="frames", model="chain", **options):
        self.model = trajopt.load_model(model)
        self.problem = trajopt.Problem(
            self.model,
            duration=float(steps.sum()),
            dt=steps if np.ptp(steps) else float(steps[0]),
            formulation=formulation,
            frames_per_knot=5,
            contact=CONTACT,
            **options,
        ).add(*added)
        self.transcription = Transcription(self.problem)
        self.initial = self.transcription.initial_frames(Stage())
        self.core = self.transcription.core_problem(Stage(), self.initial)
        self.scales = self.transcription.scales
        rng = np.random.default_rng(5)
        smooth = np.cumsum(rng.normal(scale=0.02, size=(len(steps), self.model.ndof)), axis=0)
        smooth[:, 2] = -0.01 + 0.003 * rng.normal(size=len(steps))
        self.x = self.model.integrate(np.tile(self.initial[1], (len(steps), 1)), smooth)
        self.all = np.concatenate([self.initial, self.x])
        self.state = self.core.state_from_frames(self.transcription.to_core(self.x))

    def move(self, frames, height):
        """Lift some of the frames by a height [m]."""
        self.x[frames, 2] += height
        self.all = np.concatenate([self.initial, self.x])
        self.state = self.core.state_from_frames(self.transcription.to_core(self.x))

    def values(self):
        """Values of the terms without the factors that normalize them."""
        found = self.core.evaluate(self.state)["terms"]
        factors = self.transcription.factors
        return {
            name: value / factors.get(name, 1.0)
            for name, value in zip(self.transcription.term_names, found, strict=True)
        }

    def rate(self, values, steps=STEPS):
        """Backward differences (N, ...) of values at frames -1 .. N."""
        return np.diff(values[1:], axis=0) / steps.reshape(-1, *[1] * (values.ndim - 1))

    def forces(self, steps):
        """Contact forces (N + 1, P, 3) of frames 0 .. N by backward velocities."""
        places = self.model.contact_positions(self.all)
        h = np.concatenate([steps[:1], steps])[:, None, None]
        velocity = np.diff(places, axis=0) / h
        depth = np.maximum(self.model.point_radius - places[1:, :, 2], 0.0)
        y = 1 - CONTACT.damping * velocity[..., 2]
        smooth = np.where(y > 0.5, y, np.where(y < -0.5, 0.0, (y + 0.5) ** 2 / 2))
        out = -CONTACT.friction * depth[..., None] ** 2 * velocity
        out[..., 2] = CONTACT.normal * depth**2 * smooth
        assert (out[..., 2] > 0).any()
        return out, velocity, depth

    def residual(self, steps=EVEN):
        """Generalized forces (N, D), torques of balls in the axes before them, scaled."""
        force = self.model.dynamics_residual(
            self.all[2:], self.all[1:-1], self.all[:-2], steps[0], self.problem.world, CONTACT
        )
        return force / self.scales.generalized_force


def check(scene, name, expected):
    assert scene.values()[name] == pytest.approx(expected, rel=1e-9)
    assert expected > 0


def test_center_of_mass_velocity():
    target, axes = np.array([0.4, -0.1, 0.2]), np.array([1.0, 2.0, 0.5])
    scene = Scene(terms.CenterOfMassVelocity(target, axes=axes))
    rate = scene.rate(scene.model.center_of_mass(scene.all))
    error = axes * (rate - target) / scene.scales.velocity
    check(scene, "center_of_mass_velocity", np.sum(SHARE * np.sum(error**2, axis=1)))


def test_start_leaves_out_the_beginning():
    scene = Scene(terms.CenterOfMassVelocity((1.0, 0, 0), start=0.2))
    rate = scene.rate(scene.model.center_of_mass(scene.all))
    error = (rate - [1.0, 0, 0]) / scene.scales.velocity
    share = STEPS * (scene.problem.times >= 0.2)
    assert 0 < np.count_nonzero(share) < len(STEPS)
    expected = np.sum(share * np.sum(error**2, axis=1)) / share.sum()
    check(scene, "center_of_mass_velocity", expected)


@pytest.mark.parametrize("relative", [False, True])
def test_center_of_mass_position(relative):
    scene = Scene(terms.CenterOfMassPosition((0.5, 0.1, 0.3), relative=relative))
    target = np.array([0.5, 0.1, 0.3])
    if relative:
        target = target + scene.model.center_of_mass(scene.initial[1])
    error = (scene.model.center_of_mass(scene.x) - target) / scene.scales.length
    check(scene, "center_of_mass_position", np.sum(SHARE * np.sum(error**2, axis=1)))


def test_positions_at_their_times():
    positions = np.array([[0.2, 0, 0.1], [0.4, 0.1, 0.2]])
    scene = Scene(terms.CenterOfMassPosition(positions, time=[0.1, 0.39], weight=3.0))
    center = scene.model.center_of_mass(scene.x)
    nearest = [np.argmin(np.abs(scene.problem.times - t)) for t in (0.1, 0.39)]
    assert nearest == [2, 9]
    error = (center[nearest] - positions) / scene.scales.length
    check(scene, "center_of_mass_position", 3.0 * np.sum(error**2) / 2)


def place(scene, frames, body, point):
    frame = scene.model.transforms(frames)[:, scene.model.body_names.index(body)]
    return frame[:, :, :3] @ np.array(point) + frame[:, :, 3]


def test_point_position():
    body = trajopt.load_model("chain").body_names[1]
    point = (0.05, 0.02, -0.01)
    scene = Scene(terms.PointPosition(body, (0.3, 0, 0.2), point=point, time=0.3))
    nearest = np.argmin(np.abs(scene.problem.times - 0.3))
    error = (place(scene, scene.x, body, point)[nearest] - [0.3, 0, 0.2]) / scene.scales.length
    check(scene, "point_position", np.sum(error**2))


def test_point_velocity():
    body = trajopt.load_model("chain").body_names[-1]
    point = (0.05, 0.02, -0.01)
    scene = Scene(terms.PointVelocity(body, (0.3, 0, 0.2), point=point, axes=(1, 0, 2)))
    rate = scene.rate(place(scene, scene.all, body, point))
    error = np.array([1, 0, 2]) * (rate - [0.3, 0, 0.2]) / scene.scales.velocity
    check(scene, "point_velocity", np.sum(SHARE * np.sum(error**2, axis=1)))


def test_pose_counts_the_actuated_coordinates():
    scene = Scene(terms.Pose("initial"))
    error = scene.model.difference(scene.initial[1], scene.x) * scene.model.actuated
    check(scene, "pose", np.sum(SHARE * np.sum(error**2, axis=1)))


def test_pose_by_name_and_as_keyframes():
    names = trajopt.load_model("chain").dof_names
    scene = Scene(terms.Pose({names[8]: 0.4, names[2]: 0.7}))
    error = (scene.x[:, [8, 2]] - [0.4, 0.7]) / scene.scales.coordinate[[8, 2]]
    check(scene, "pose", np.sum(SHARE * np.sum(error**2, axis=1)))

    rng = np.random.default_rng(1)
    keys = 0.3 * rng.normal(size=(2, 14))
    scene = Scene(terms.Pose(keys, time=[0.15, 0.4], dofs=names[3:8]))
    assert [round(t, 9) for t in scene.problem.times[[3, 9]]] == [0.15, 0.4]
    error = scene.model.difference(keys, scene.x[[3, 9]])[:, 3:8]
    check(scene, "pose", np.sum(error**2) / 2)


def test_terminal_pose_and_rest():
    scene = Scene(terms.TerminalPose(weight=0.5))
    counted = np.ones(14)
    counted[[0, 1, 5]] = 0
    error = scene.model.difference(scene.initial[1], scene.x)[-2:] / scene.scales.coordinate
    each = 0.5 / counted.sum()
    check(scene, "terminal_pose", each * np.sum(counted * error**2))
    rate = scene.model.difference(scene.x[-3:-1], scene.x[-2:]) / scene.scales.coordinate
    rate *= scene.scales.time / STEPS[-2:, None]
    check(scene, "terminal_pose velocity", each * np.sum(rate**2))


def test_smoothness_on_an_uneven_grid():
    scene = Scene(terms.Smoothness(weight=2.0))
    before = np.concatenate([STEPS[:1], STEPS])
    rate = scene.model.difference(scene.all[:-1], scene.all[1:]) / before[:, None]
    mean = (before[1:] + before[:-1]) / 2
    bend = np.diff(rate, axis=0) / mean[:, None]
    bend *= scene.scales.time**2 / scene.scales.coordinate
    check(scene, "smoothness", 2.0 * np.sum(SHARE * np.sum(bend**2, axis=1)))


def test_joint_velocity():
    scene = Scene(terms.JointVelocity(weight=2.0))
    rate = scene.rate(scene.all)[:, scene.model.actuated] * scene.scales.time
    check(scene, "joint_velocity", 2.0 * np.sum(SHARE * np.sum(rate**2, axis=1)))


def test_control_effort_and_physics_penalty():
    scene = Scene(terms.ControlEffort(2.0), terms.PhysicsPenalty(3.0), steps=EVEN)
    force = scene.residual()
    motors = scene.model.actuated
    check(scene, "control_effort", 2.0 * np.sum(force[:, motors] ** 2) / 10)
    middle = scene.all[1:-1]  # where the scheme tests its equations
    rows = torque_rows(scene.model, middle, force)[:, ~motors]
    size = scene.values()["physics_penalty"]
    assert size == pytest.approx(3.0 * np.sum(rows**2) / 10, rel=1e-2)
    exact = scene.core.evaluate(scene.state)["frame_constraint"]
    assert size == pytest.approx(3.0 * np.sum(exact**2) / 10, rel=1e-12)


def test_contact_force_rate():
    scene = Scene(terms.ContactForceRate(2.0))
    force, _, _ = scene.forces(STEPS)
    rate = np.diff(force, axis=0) / STEPS[:, None, None]
    rate *= scene.scales.time / scene.scales.force
    check(scene, "contact_force_rate", 2.0 * np.sum(SHARE * np.sum(rate**2, axis=(1, 2))))


def test_contact_slip():
    scene = Scene(terms.ContactSlip(2.0))
    _, velocity, depth = scene.forces(STEPS)
    slip = np.sum(velocity[1:, :, :2] ** 2, axis=2) / scene.scales.velocity**2
    load = CONTACT.normal * depth[1:] ** 2 / scene.scales.force
    check(scene, "contact_slip", 2.0 * np.sum(SHARE * np.sum(load * slip, axis=1)))


def test_contact_impact():
    scene = Scene(terms.ContactImpact(2.0))
    scene.move(slice(3, 6), height=0.1)
    _, velocity, depth = scene.forces(STEPS)
    speed = velocity[1:, :, 2] ** 2 / scene.scales.velocity**2
    load = CONTACT.normal * (depth[1:] ** 2 + depth[:-1] ** 2) / scene.scales.force
    assert np.any((depth[1:] == 0) & (depth[:-1] > 0))  # some leave the ground, ...
    assert np.any((depth[1:] > 0) & (depth[:-1] == 0))  # ... and some strike it
    check(scene, "contact_impact", 2.0 * np.sum(SHARE * np.sum(load * speed, axis=1)))


CHAIN = trajopt.load_model("chain")
NAME, DOF = CHAIN.body_names[1], CHAIN.dof_names[2]
ALL = {
    "velocity": lambda: terms.CenterOfMassVelocity((0.4, 0, 0.1), start=0.1),
    "position": lambda: terms.CenterOfMassPosition((0.4, 0, 0.1), axes=(1, 0.5, 2)),
    "point": lambda: terms.PointPosition(NAME, (0.3, 0, 0.2), point=(0.1, 0, 0), time=0.2),
    "point_velocity": lambda: terms.PointVelocity(NAME, (0.3, 0, 0.2), point=(0.1, 0, 0)),
    "pose": lambda: terms.Pose(0.2 * np.arange(14.0) / 14, dofs=CHAIN.dof_names),
    "terminal": lambda: terms.TerminalPose(1.0),
    "effort": terms.ControlEffort,
    "smoothness": terms.Smoothness,
    "rate": terms.ContactForceRate,
    "slip": terms.ContactSlip,
    "impact": terms.ContactImpact,
    "joint_velocity": terms.JointVelocity,
    "physics": terms.PhysicsPenalty,
}


@pytest.mark.parametrize("formulation", ["frames", "spline"])
@pytest.mark.parametrize("kind", ALL)
def test_gradient(kind, formulation):
    scene = Scene(ALL[kind](), steps=EVEN, formulation=formulation)
    check_gradient(scene)


def check_gradient(scene, directions=4, h=1e-6):
    core, state = scene.core, scene.state
    gradient = core.linearize(state)["gradient"].ravel()
    scale = np.linalg.norm(gradient)
    assert scale > 0
    rng = np.random.default_rng(0)
    for _ in range(directions):
        d = rng.normal(size=gradient.size)
        up, down = (core.evaluate(core.retract(state, s * h * d))["objective"] for s in (1, -1))
        assert (up - down) / (2 * h) == pytest.approx(gradient @ d, rel=2e-6, abs=2e-6 * scale)


@pytest.mark.parametrize("kind", ["velocity", "smoothness", "terminal", "rate", "slip"])
def test_gradient_on_an_uneven_grid(kind):
    check_gradient(Scene(ALL[kind]()))


def test_every_kind_is_tested():
    kinds = {type(make()).__name__ for make in ALL.values()} | {"Residual", "regularizers"}
    assert kinds == set(terms.__all__)


def test_tasks_cost_their_weight_on_the_guess():
    scene = Scene(
        terms.CenterOfMassVelocity((0.4, 0, 0), weight=2.5),
        terms.CenterOfMassPosition((1, 0, 0), time=0.4, weight=0.5),
        terms.ControlEffort(0.7),
    )
    rest = np.tile(scene.initial[1], (10, 1))
    found = scene.core.evaluate(scene.core.state_from_frames(scene.transcription.to_core(rest)))
    values = dict(zip(scene.transcription.term_names, found["terms"], strict=True))
    assert values["center_of_mass_velocity"] == pytest.approx(2.5, rel=1e-12)
    assert values["center_of_mass_position"] == pytest.approx(0.5, rel=1e-12)
    assert scene.transcription.factors.get("control_effort", 1.0) == 1.0


def test_a_task_that_is_met_already_keeps_its_scale():
    scene = Scene(terms.CenterOfMassVelocity((0, 0, 0)), terms.ControlEffort())
    assert scene.transcription.factors["center_of_mass_velocity"] == 1.0


def test_terms_of_one_kind_are_numbered():
    scene = Scene(terms.Pose(time=0.1), terms.Pose(time=0.2), terms.ControlEffort())
    assert scene.transcription.term_names == ["control_effort", "pose", "pose 2"]


def test_weights_scale_with_the_weight_not_with_the_grid():
    coarse = Scene(terms.Smoothness(), steps=EVEN)
    halves = np.repeat(EVEN / 2, 2)
    fine = Scene(terms.Smoothness(), steps=halves)
    uneven = Scene(terms.Smoothness())
    for scene in (coarse, fine, uneven):
        t = scene.problem.times[:, None]
        x = np.tile(scene.initial[1], (len(t), 1))
        x[:, 7:8] = 0.5 * 3.0 * t**2
        x[:, 7:8] += scene.initial[1][7]
        state = scene.core.state_from_frames(scene.transcription.to_core(x))
        value = scene.core.evaluate(state)["objective"]
        full = 3e-3 * (3.0 * scene.scales.time**2) ** 2
        first = scene.problem.steps[0] / 0.4  # frame 1 still feels the rest before
        assert value == pytest.approx(full, rel=1.1 * first)


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (terms.CenterOfMassVelocity((0.3, 0)), "CenterOfMassVelocity: velocity has shape (2,)"),
        (terms.CenterOfMassVelocity((0.3, 0, 0), start=9), "start = 9 s lies behind the end"),
        (terms.CenterOfMassVelocity((0.3, 0, 0), start=-1), "start must be >= 0"),
        (terms.CenterOfMassVelocity((np.nan, 0, 0)), "velocity[0] = nan"),
        (terms.CenterOfMassPosition((1, 0, 0), time=3.0), "time = 3 s lies outside the motion"),
        (terms.CenterOfMassPosition((1, 0, 0), time=np.nan), "time[0] = nan"),
        (terms.CenterOfMassPosition((1, 0, 0), time="noon"), "time must be an array of numbers"),
        (terms.CenterOfMassPosition([(1, 0, 0)] * 3, time=0.1), "3 positions need as many times"),
        (terms.CenterOfMassPosition([(1, 0, 0), (1, 0)]), "position must be an array of numbers"),
        (terms.PointPosition("wing", (0, 0, 0)), "no body is called 'wing'; the model has"),
        (terms.PointPosition(NAME, (0, 0, 0), point=(1, 2)), "point has shape (2,)"),
        (terms.PointVelocity(NAME, (0, 0)), "PointVelocity: velocity has shape (2,)"),
        (terms.Pose("sit"), "pose = 'sit', expected an array or 'initial'"),
        (terms.Pose(np.zeros(3)), "Pose: pose has shape (3,), expected (14,)"),
        (terms.Pose({"tail": 1.0}), "no coordinate is called 'tail'"),
        (terms.Pose({DOF: "up"}), "must be a number, not str 'up'"),
        (terms.Pose({}), "names no coordinate"),
        (terms.Pose(dofs="tail"), "no coordinate is called 'tail'"),
        (terms.Pose(dofs=3), "dofs must be a list of names, not 3"),
        (terms.Pose(np.zeros((2, 14)), time=0.1), "2 poses need as many times, got 1"),
        (
            terms.CenterOfMassPosition(np.eye(3), time=[0.1, 0.3, 0.301]),
            "3 positions fall on 2 frames; times must lie at least a time step apart",
        ),
    ],
)
def test_mistakes_in_terms_are_found_when_they_are_added(term, message):
    problem = trajopt.Problem(CHAIN, duration=float(STEPS.sum()), dt=STEPS)
    with pytest.raises(trajopt.TrajoptError) as caught:
        problem.add(terms.ControlEffort(), term)
    assert isinstance(caught.value, (ValueError, TypeError))
    assert str(caught.value).startswith(f"{type(term).__name__}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert problem.terms == []


@pytest.mark.parametrize("weight", [-1.0, float("nan"), "much", None, True])
@pytest.mark.parametrize("kind", [terms.ControlEffort, terms.Smoothness, terms.ContactSlip])
def test_weights_are_checked_at_once(kind, weight):
    with pytest.raises(trajopt.TrajoptError, match=f"{kind.__name__}: weight must be"):
        kind(weight=weight)


def test_regularizers_scale_together():
    once, twice = terms.regularizers(), terms.regularizers(2.0)
    assert [2 * term.weight for term in once] == [term.weight for term in twice]
