"""Model: tangents, scaling, persistence, arguments."""

import dataclasses

import numpy as np
import pytest

from trajopt import ArgumentError, ArgumentTypeError, Contact, Model, ModelError, World
from trajopt.models import load_model

BALLS = (
    '<body name="a"><freejoint/><geom size=".1" mass="1"/>'
    '<body name="b" pos="0 0 .5"><joint type="ball"/><geom size=".1" pos=".2 0 0"/>'
    '<body name="c" pos="0 0 .5"><joint type="slide" axis="1 0 0"/><geom size=".1"/>'
    "</body></body></body>"
)


@pytest.fixture
def balls(mjcf):
    return mjcf(BALLS)


def test_integrate_and_difference_are_inverse(balls):
    rng = np.random.default_rng(0)
    x = rng.normal(size=(20, balls.ndof))
    delta = rng.uniform(-1.5, 1.5, size=(20, balls.ndof))  # rotations below π
    y = balls.integrate(x, delta)
    np.testing.assert_allclose(balls.difference(x, y), delta, atol=1e-12)
    np.testing.assert_allclose(balls.integrate(x, balls.difference(x, y)), y, atol=1e-12)


def test_integrate_turns_in_the_world(balls):
    x = np.zeros(balls.ndof)
    x[3:6] = [0, 0, np.pi / 2]
    delta = np.zeros(balls.ndof)
    delta[3:6] = [0.3, 0, 0]
    turned = balls.transforms(balls.integrate(x, delta))[0, :, :3]
    np.testing.assert_allclose(turned @ [1, 0, 0], [0, np.cos(0.3), np.sin(0.3)], atol=1e-12)


def test_integrate_is_continuous_through_whole_turns(balls):
    x = np.zeros(balls.ndof)
    delta = np.zeros(balls.ndof)
    delta[4] = 0.1
    for _ in range(100):
        ahead = balls.integrate(x, delta)
        assert np.abs(ahead - x).max() < 0.11
        x = ahead
    assert x[4] == pytest.approx(10)


def test_batches_broadcast(balls):
    x = np.random.default_rng(1).normal(size=(2, 3, balls.ndof))
    assert balls.transforms(x).shape == (2, 3, 3, 3, 4)
    assert balls.center_of_mass(x).shape == (2, 3, 3)
    np.testing.assert_array_equal(balls.transforms(x)[1, 2], balls.transforms(x[1, 2]))


def test_length_does_not_depend_on_where_the_model_stands():
    model = load_model("mammal")
    moved = model.home.copy()
    moved[:2] += 100
    assert model.replace(home=moved).length == pytest.approx(model.length)


def test_core_arguments_are_scaled():
    model = load_model("mammal")
    plain, scaled = model.core_arguments(), model.core_arguments(mass=40.0, length=0.5)
    ratio = scaled["link_inertia"] / np.where(plain["link_inertia"] == 0, 1, plain["link_inertia"])
    last = ratio[-1]
    assert last[3, 3] == pytest.approx(1 / 40)
    assert scaled["point_radius"] == pytest.approx(plain["point_radius"] / 0.5)
    assert scaled["joint_offset"][:, :, 3] == pytest.approx(plain["joint_offset"][:, :, 3] / 0.5)
    assert scaled["upper"][6:] == pytest.approx(plain["upper"][6:])  # angles stay
    assert np.isinf(scaled["upper"][:6]).all()


def test_scaled_limits_of_slides(mjcf):
    model = mjcf('<body><joint type="slide" limited="true" range="-1 2"/><geom size="1"/></body>')
    arguments = model.core_arguments(length=0.5)
    assert (arguments["lower"].item(), arguments["upper"].item()) == (-2, 4)


@pytest.mark.parametrize("name", ["chain", "humanoid"])
def test_dictionary_restores_every_bit(name, tmp_path):
    model = load_model(name)
    np.savez(tmp_path / "model.npz", **model.to_dict())
    with np.load(tmp_path / "model.npz", allow_pickle=False) as data:
        again = Model.from_dict(data)
    for field in dataclasses.fields(Model):
        one, two = getattr(model, field.name), getattr(again, field.name)
        if isinstance(one, np.ndarray):
            assert one.dtype == two.dtype
            np.testing.assert_array_equal(one, two)
        else:
            assert one == two


def test_incomplete_dictionary():
    data = load_model("chain").to_dict()
    del data["home"]
    with pytest.raises(ModelError, match="lacks 'home'"):
        Model.from_dict(data)


def test_immutable():
    model = load_model("chain")
    with pytest.raises(ValueError, match="read-only"):
        model.home[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.name = "other"


def test_configurations_are_checked():
    model = load_model("chain")
    with pytest.raises(ArgumentError, match=r"x has shape \(3,\); model 'chain' needs \(..., 14\)"):
        model.transforms(np.zeros(3))
    bad = model.home.copy()
    bad[7] = np.nan
    with pytest.raises(ArgumentError, match="not finite at dof 'front_pitch'"):
        model.center_of_mass(bad)
    with pytest.raises(ArgumentTypeError, match="array of numbers"):
        model.transforms("home")


class TestDynamics:
    """Arguments and units; the values are the core's own tests' business."""

    @pytest.fixture(autouse=True)
    def _core(self):
        pytest.importorskip("trajopt._core")

    def frames(self, model, shape=()):
        rng = np.random.default_rng(2)
        x = model.home + 0.05 * rng.normal(size=(3, *shape, model.ndof))
        x[..., 2] -= 0.02  # into the ground
        return x

    @pytest.mark.parametrize("name", ["chain", "mammal", "humanoid"])
    def test_core_kinematics_agree(self, name):
        from trajopt import _core

        model = load_model(name)
        core = _core.Model(**model.core_arguments())
        x = np.random.default_rng(3).normal(size=(5, model.ndof))
        np.testing.assert_allclose(core.kinematics(x), model.joint_transforms(x), atol=1e-13)
        np.testing.assert_allclose(core.center_of_mass(x), model.center_of_mass(x), atol=1e-13)

    def test_at_rest_gravity_is_the_weight(self):
        model = load_model("mammal")
        force = model.dynamics_residual(model.home, model.home, model.home, 0.025)
        np.testing.assert_allclose(force[:3], [0, 0, model.mass * 9.81], atol=1e-9)

    def test_default_contact_carries_the_weight_at_its_depth(self):
        model = load_model("spider")  # its four feet carry nearly equal shares
        x = model.home.copy()
        x[2] -= 0.008 * model.length + float(model.lowest_point(x))
        force = model.dynamics_residual(x, x, x, 0.025, contact=Contact())
        assert abs(force[2]) < 1e-3 * model.mass * 9.81

    def test_batch_equals_single(self):
        model = load_model("mammal")
        x, x1, x2 = self.frames(model, (2, 3))
        batch = model.dynamics_residual(x, x1, x2, 0.025, contact=Contact())
        jacobians = model.dynamics_jacobians(x, x1, x2, [0.02, 0.025, 0.03], contact=Contact())
        assert batch.shape == (2, 3, 18)
        one = model.dynamics_residual(x[1, 2], x1[1, 2], x2[1, 2], 0.025, World(), Contact())
        np.testing.assert_array_equal(batch[1, 2], one)
        single = model.dynamics_jacobians(x[1, 2], x1[1, 2], x2[1, 2], 0.03, World(), Contact())
        for many, alone in zip(jacobians, single, strict=True):
            np.testing.assert_array_equal(many[1, 2], alone)

    def test_units_of_mass_and_length_do_not_matter(self):
        from trajopt import _core

        model = load_model("biped")
        mass, length = model.mass, model.length
        time = np.sqrt(length / 9.81)
        core = _core.Model(**model.core_arguments(mass, length))
        physics = _core.Physics(gravity=(0, 0, -1), ground=False)
        unit = np.ones(model.ndof)
        unit[:3] = length
        x, x1, x2 = self.frames(model)
        scaled = core.residual(*(v[None] / unit for v in (x, x1, x2)), [0.025 / time], physics)
        force = model.dynamics_residual(x, x1, x2, 0.025)
        np.testing.assert_allclose(
            scaled[0] * mass * 9.81 * length / unit, force, rtol=1e-9, atol=1e-9
        )

    @pytest.mark.parametrize("dt", [0, -0.1, np.nan, np.inf])
    def test_bad_steps(self, dt):
        model = load_model("chain")
        with pytest.raises(ArgumentError, match="dt must be positive"):
            model.dynamics_residual(model.home, model.home, model.home, dt)

    def test_bad_arguments(self):
        model = load_model("chain")
        home = model.home
        with pytest.raises(ArgumentError, match="integrator must be one of"):
            model.dynamics_residual(home, home, home, 0.1, integrator="euler")
        with pytest.raises(ArgumentTypeError, match="world must be a World"):
            model.dynamics_residual(home, home, home, 0.1, world="flat")
        with pytest.raises(ArgumentError, match="do not broadcast"):
            model.dynamics_residual(np.tile(home, (2, 1)), np.tile(home, (3, 1)), home, 0.1)
