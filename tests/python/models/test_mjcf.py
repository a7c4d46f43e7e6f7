"""MJCF: kinematics and inertia of every kind of joint against MuJoCo itself."""

import mujoco
import numpy as np
import pytest

from trajopt import ModelError, ModelWarning
from trajopt.models.coordinates import to_qpos

from .helpers import assert_same_kinematics, random_configurations, wrap

G = '<geom type="box" size=".1 .2 .3" pos=".1 0 .05" euler=".3 .1 0" mass="2"/>'

TREES = {
    "hinge": f'<body name="a" pos="1 2 3" euler=".1 .2 .3"><joint axis="0 1 0"/>{G}</body>',
    "anchored hinge": (
        f'<body name="a" euler=".4 0 0"><joint axis="1 2 3" pos=".3 -.2 .1"/>{G}</body>'
    ),
    "slide": (
        f'<body name="a" euler="0 .4 0"><joint type="slide" axis="1 0 2" pos="1 1 1"/>{G}</body>'
    ),
    "reference angle": f'<body name="a"><joint axis="0 1 1" ref=".7" pos=".1 0 0"/>{G}</body>',
    "reference slide": f'<body name="a"><joint type="slide" axis="0 1 1" ref=".7"/>{G}</body>',
    "ball": f'<body name="a" euler="1 0 0"><joint type="ball" pos=".1 .2 .3"/>{G}</body>',
    "free": f'<body name="a" pos="1 0 0" euler="1 0 0"><freejoint/>{G}</body>',
    "three hinges on a body": (
        '<body name="a" pos="0 0 1"><joint axis="1 0 0" pos="0 .1 0"/><joint axis="0 1 0"/>'
        f'<joint axis="0 0 1" pos=".2 0 0"/>{G}</body>'
    ),
    "slide, hinge and ball on a body": (
        '<body name="a" euler=".3 0 0"><joint type="slide" axis="1 1 0"/>'
        f'<joint axis="0 1 0" pos="0 0 .2"/><joint type="ball" pos=".1 0 0"/>{G}</body>'
    ),
    "fixed bodies merged": (
        f'<body name="a"><freejoint/>{G}<body name="b" pos=".5 0 0" euler="0 .5 0">{G}'
        f'<body name="c" pos="0 .4 0"><joint axis="0 0 1" pos="0 0 .1"/>{G}'
        f'<body name="d" pos="0 0 .3" euler="1 1 1">{G}</body></body></body></body>'
    ),
    "branches": (
        f'<body name="a"><freejoint/>{G}'
        f'<body name="b" pos=".5 0 0"><joint axis="0 1 0"/>{G}</body>'
        f'<body name="c" pos="-.5 0 0"><joint type="ball"/>{G}'
        f'<body name="e" pos="0 0 -1"><joint axis="1 0 0"/>{G}</body></body></body>'
    ),
    "two free bodies": (
        f'<body name="a"><freejoint/>{G}</body><body name="b"><freejoint/>{G}</body>'
    ),
    "arm on a fixed stand": (
        f'<body name="stand" pos="0 0 1" euler="0 0 1">{G}'
        f'<body name="a" pos=".2 0 .3"><joint axis="0 0 1"/>{G}</body></body>'
    ),
}


@pytest.mark.parametrize("name", TREES)
def test_kinematics_and_mass(mjcf, name):
    model = mjcf(TREES[name])
    reference = mujoco.MjModel.from_xml_string(wrap(TREES[name]))
    assert_same_kinematics(model, reference)


@pytest.mark.parametrize("name", TREES)
def test_link_inertia_gives_the_kinetic_energy(mjcf, name):
    """½ Σ tr(Ṫ M Ṫᵀ) from numerical velocities equals MuJoCo's ½ v·M·v."""
    model = mjcf(TREES[name])
    reference = mujoco.MjModel.from_xml_string(wrap(TREES[name]))
    data = mujoco.MjData(reference)
    rng = np.random.default_rng(1)
    for x in random_configurations(model, 3, seed=1):
        velocity = rng.normal(size=model.ndof)
        h = 1e-5
        rate = model.joint_transforms(x + h * velocity) - model.joint_transforms(x - h * velocity)
        rate = rate / (2 * h)
        energy = 0.5 * np.einsum("jab,jbc,jac->", rate, model.link_inertia, rate)
        data.qpos[:] = to_qpos(reference, x)
        ahead = to_qpos(reference, x + h * velocity)
        behind = to_qpos(reference, x - h * velocity)
        mujoco.mj_differentiatePos(reference, data.qvel, 2 * h, behind, ahead)
        mujoco.mj_fwdPosition(reference, data)
        mujoco.mj_energyVel(reference, data)
        np.testing.assert_allclose(energy, data.energy[1], rtol=1e-7)


def test_order_and_names_of_dofs(mjcf):
    model = mjcf(
        f'<body name="a"><freejoint name="root"/>{G}'
        f'<body name="b"><joint name="knee" range="-1 .5" limited="true"/>{G}'
        f'<body name="c"><joint name="neck" type="ball"/>{G}</body></body></body>'
    )
    assert model.dof_names == (
        *("root_tx", "root_ty", "root_tz", "root_rx", "root_ry", "root_rz"),
        *("knee", "neck_rx", "neck_ry", "neck_rz"),
    )
    assert model.lower[6] == -1
    assert model.upper[6] == 0.5
    assert np.isinf(np.delete(model.upper, 6)).all()
    assert (model.joint_parent < np.arange(len(model.joint_parent))).all()


def test_free_root_is_not_actuated_without_actuators(mjcf):
    model = mjcf(TREES["branches"])
    assert model.actuated.tolist() == [False] * 6 + [True] * 5


def test_actuators_decide_what_is_actuated(mjcf):
    body = (
        f'<body name="a"><joint name="cart" type="slide" axis="1 0 0"/>{G}'
        f'<body name="b"><joint name="pole" axis="0 1 0"/>{G}</body></body>'
    )
    motor = '<actuator><motor name="push" joint="cart"/></actuator>'
    with pytest.warns(ModelWarning, match="gains and force ranges of actuator push"):
        model = mjcf(body, motor)
    assert model.actuated.tolist() == [True, False]
    assert any("passive joints: pole" in note for note in model.notes)
    with pytest.warns(ModelWarning):
        assert mjcf(body, motor, actuated="joints").actuated.all()
    with pytest.raises(ModelError, match="no actuators"):
        mjcf(body, actuated="actuators")


def test_base_can_be_fixed_and_freed(mjcf):
    free = TREES["branches"]
    fixed = mjcf(free, base="fixed")
    assert fixed.ndof == 5
    assert "a" not in fixed.body_names
    reference = mujoco.MjModel.from_xml_string(wrap(free.replace("<freejoint/>", "")))
    assert_same_kinematics(fixed, reference)
    arm = TREES["arm on a fixed stand"]
    floating = mjcf(arm, base="floating")
    assert floating.ndof == 7
    assert floating.body_names[0] == "stand"
    with pytest.raises(ModelError, match="needs a root body without joints, but 'a'"):
        mjcf(TREES["hinge"], base="floating")


def test_home_is_the_keyframe(mjcf):
    key = '<keyframe><key name="other" qpos="9"/><key name="home" qpos=".5"/></keyframe>'
    assert mjcf(TREES["hinge"], key).home.tolist() == [0.5]


def test_home_without_keyframe_lies_within_the_limits(mjcf):
    model = mjcf(f'<body name="a"><joint limited="true" range=".2 1"/>{G}</body>')
    assert model.home.tolist() == [0.2]


def test_include(tmp_path, load_text):
    (tmp_path / "part.xml").write_text(f"<mujoco>{G}</mujoco>")
    model = load_text(wrap('<body name="a"><freejoint/><include file="part.xml"/></body>'))
    assert model.mass == pytest.approx(2)


def test_canonical_xml_reloads(mjcf, load_text):
    model = mjcf(TREES["branches"])
    again = load_text(model.xml)
    x = random_configurations(model)
    np.testing.assert_allclose(again.transforms(x), model.transforms(x), atol=1e-5)
    np.testing.assert_allclose(again.link_inertia, model.link_inertia, atol=1e-4)
