"""URDF as found in the wild."""

import warnings

import mujoco
import numpy as np
import pinocchio
import pytest

from trajopt import ModelError, ModelWarning

from .helpers import assert_same_kinematics

INERTIAL = (
    '<inertial><origin xyz=".1 0 .05" rpy=".2 .1 0"/><mass value="{mass}"/>'
    '<inertia ixx=".3" iyy=".4" izz=".5" ixy=".01" ixz="0" iyz=".02"/></inertial>'
)


def link(name, mass=None, collision=""):
    inertial = "" if mass is None else INERTIAL.format(mass=mass)
    shape = f"<collision><geometry>{collision}</geometry></collision>" if collision else ""
    return f'<link name="{name}">{inertial}{shape}</link>'


def joint(
    name,
    parent,
    child,
    kind="revolute",
    inside='<limit lower="-1" upper="2" effort="1" velocity="1"/>',
):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz=".2 .1 .3" rpy=".1 .2 .3"/><axis xyz="0 1 0"/>{inside}</joint>'
    )


def robot(*parts):
    return f'<robot name="wild">{"".join(parts)}</robot>'


LEG = robot(
    link("base", 3, '<box size=".4 .2 .1"/>'),
    link("hip"),  # massless, moved by a joint of its own
    link("thigh", 2),
    link("foot", 0.5, '<sphere radius=".03"/>'),
    link("sensor"),
    joint("yaw", "base", "hip"),
    joint("pitch", "hip", "thigh"),
    joint("ankle", "thigh", "foot", "fixed"),
    joint("mount", "base", "sensor", "fixed"),
)


def test_root_floats_by_default(load_text):
    model = load_text(LEG, ".urdf")
    assert model.name == "wild"
    assert model.ndof == 8
    assert model.nactuated == 2
    assert model.body_names == ("base", "hip", "thigh", "foot", "sensor")
    assert any("floating base" in note for note in model.notes)
    assert (model.lower[6:] == -1).all()
    assert (model.upper[6:] == 2).all()
    assert set(model.feet) == {"foot"}


def test_fixed_base(load_text):
    model = load_text(LEG, ".urdf", base="fixed")
    assert model.ndof == 2
    assert model.mass == pytest.approx(2.5)  # the base no longer moves


def test_root_called_world_is_fixed(load_text):
    arm = robot(
        link("world"), link("arm", 1), link("hand", 1),
        joint("a", "world", "arm"), joint("b", "arm", "hand"),
    )  # fmt: skip
    with pytest.warns(ModelWarning, match="no collision geometry"):
        assert load_text(arm, ".urdf").ndof == 2


@pytest.mark.parametrize("base", ["floating", "fixed"])
def test_kinematics_and_mass_equal_pinocchio(load_text, tmp_path, base):
    """An oracle that shares no code with MuJoCo's URDF reader."""
    model = load_text(LEG, ".urdf", base=base)
    root = [pinocchio.JointModelFreeFlyer()] if base == "floating" else []
    reference = pinocchio.buildModelFromXML(LEG, *root)
    data = reference.createData()
    free = 6 if base == "floating" else 0
    for x in np.random.default_rng(0).uniform(-1, 1, (5, model.ndof)):
        q = x[free:]
        if free:
            rotation = pinocchio.Quaternion(pinocchio.exp3(x[3:6])).coeffs()
            q = np.concatenate([x[:3], rotation, q])
        pinocchio.framesForwardKinematics(reference, data, q)
        for k, name in enumerate(model.body_names):
            frame = data.oMf[reference.getFrameId(name)]
            np.testing.assert_allclose(model.transforms(x)[k, :, :3], frame.rotation, atol=1e-9)
            np.testing.assert_allclose(model.transforms(x)[k, :, 3], frame.translation, atol=1e-9)
        center = pinocchio.centerOfMass(reference, data, q)
        if base == "floating":  # pinocchio counts the mass of a fixed base, which never moves
            np.testing.assert_allclose(model.center_of_mass(x), center, atol=1e-9)


def test_what_is_mounted_on_the_world_link_stays(load_text):
    text = robot(
        link("world"), link("table", 5), link("arm", 1, '<sphere radius=".1"/>'),
        joint("mount", "world", "table", "fixed"), joint("a", "table", "arm"),
    )  # fmt: skip
    assert load_text(text, ".urdf").ndof == 1
    assert load_text(text, ".urdf", base="floating").ndof == 7


def test_massless_links_weigh_nothing(load_text):
    model = load_text(LEG, ".urdf")
    assert model.pseudo_inertia[model.body_names.index("hip")].tolist() == np.zeros((4, 4)).tolist()
    assert model.mass == pytest.approx(5.5, rel=1e-14)


def test_home_of_a_floating_urdf_stands_on_the_ground(load_text):
    model = load_text(LEG, ".urdf")
    assert model.lowest_point(model.home) == pytest.approx(0, abs=1e-12)


MESH = '<mesh filename="package://wild_description/meshes/{}"/>'


def test_missing_meshes_make_one_warning(load_text):
    text = robot(
        link("base", 3, MESH.format("base.stl")),
        link("foot", 1, MESH.format("foot.dae")),
        joint("ankle", "base", "foot"),
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = load_text(text, ".urdf")
    messages = [str(w.message) for w in caught if issubclass(w.category, ModelWarning)]
    missing = [text for text in messages if "mesh files left out" in text]
    assert len(missing) == 1
    assert "base.stl not found" in missing[0]
    assert "foot.dae not found" in missing[0]
    assert any("no collision geometry" in text for text in messages)
    assert len(messages) == 2
    assert model.mass == pytest.approx(4)


def test_links_without_inertial_weigh_nothing_whatever_their_shape(load_text):
    text = robot(
        link("base", 3), link("foot", None, '<box size="1 1 1"/>'), joint("j", "base", "foot")
    )
    assert load_text(text, ".urdf").mass == pytest.approx(3)


def test_missing_mesh_that_mass_comes_from_is_refused(mjcf):
    with pytest.raises(ModelError, match=r"body 'foot' has no inertial.*foot\.stl not found"):
        mjcf(
            '<body name="foot"><freejoint/><geom type="mesh" mesh="foot"/></body>',
            '<asset><mesh name="foot" file="foot.stl"/></asset>',
        )


def test_mesh_of_a_package_is_found(tmp_path):
    """robot/package.xml marks the package, whatever its folder is called."""
    package = tmp_path / "robot"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    (package / "package.xml").write_text("<package/>")
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    obj = "".join(f"v {i} {j} {k}\n" for i, j, k in corners)
    faces = ("1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6")
    (package / "meshes" / "cube.obj").write_text(obj + "".join(f"f {f}\n" for f in faces))
    urdf = package / "urdf" / "robot.urdf"
    urdf.write_text(robot(link("base", 3, MESH.format("cube.obj"))))
    from trajopt.models import load_model

    model = load_model(urdf)
    points = {tuple(p) for p in model.point_position.round(6)}
    assert points == {(float(i), float(j), float(k)) for i, j, k in corners}
    # The canonical text carries the hull: no file is needed any more.
    reference = mujoco.MjModel.from_xml_string(model.xml)
    assert_same_kinematics(model, reference)
    again = tmp_path / "again.xml"
    again.write_text(model.xml)
    baked = load_model(again)
    assert {tuple(p) for p in baked.point_position.round(5) + 0.0} == points


def test_mimic_joint_moves_on_its_own_with_a_warning(load_text):
    text = robot(
        link("base", 1), link("a", 1), link("b", 1), joint("left", "base", "a"),
        joint("right", "base", "b", inside='<mimic joint="left" multiplier="-1"/>'
              '<limit lower="-1" upper="1" effort="1" velocity="1"/>'),
    )  # fmt: skip
    with pytest.warns(ModelWarning, match="mimic joints move on their own: right"):
        assert load_text(text, ".urdf").ndof == 8


@pytest.mark.parametrize(
    ("moments", "expected"),
    [
        ('ixx="1" iyy="1" izz="5" ixy="0" ixz="0" iyz="0"', [2.5, 2.5, 0, 1]),
        # indefinite: an eigenvalue of the tensor itself is negative
        ('ixx="1" iyy="1" izz="1" ixy="2" ixz="0" iyz="0"', None),
    ],
)
def test_impossible_inertia_is_repaired_with_a_warning(load_text, moments, expected):
    text = robot(
        f'<link name="base"><inertial><mass value="1"/><inertia {moments}/></inertial>'
        '<collision><geometry><sphere radius="1"/></geometry></collision></link>'
    )
    with pytest.warns(ModelWarning, match=r"inertia of base .*violate A \+ B >= C"):
        model = load_text(text, ".urdf")
    assert model.mass == pytest.approx(1)
    moments = np.linalg.eigvalsh(model.pseudo_inertia[0])
    assert (moments > -1e-15).all()
    if expected is not None:
        np.testing.assert_allclose(np.diag(model.pseudo_inertia[0]), expected, atol=1e-6)


def test_canonical_xml_of_a_thin_rod_compiles(load_text):
    """A + B = C to the last digit must survive the six digits of the text."""
    text = robot(
        '<link name="base"><inertial><origin rpy=".3 .2 .1" xyz="0 0 0"/><mass value="1"/>'
        '<inertia ixx="0.1234567" iyy="0.7654321" izz="0.8888888" ixy="0" ixz="0" iyz="0"/>'
        '</inertial><collision><geometry><sphere radius="1"/></geometry></collision></link>'
    )
    model = load_text(text, ".urdf")
    reference = mujoco.MjModel.from_xml_string(model.xml)
    np.testing.assert_allclose(sorted(reference.body_inertia[1])[2], 0.8888888, rtol=1e-5)


def test_ascii_stl_counts_as_missing(load_text, tmp_path):
    (tmp_path / "foot.stl").write_text("solid x\nfacet normal 0 0 1\n" + "x" * 100)
    text = robot(link("base", 3, '<mesh filename="foot.stl"/>'))
    with pytest.warns(ModelWarning, match=r"foot\.stl is not a binary STL"):
        load_text(text, ".urdf")


def test_xacro_gets_a_hint(load_text):
    text = (
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a"/></robot>'
    )
    with pytest.raises(ModelError, match="expand them first"):
        load_text(text, ".urdf")
