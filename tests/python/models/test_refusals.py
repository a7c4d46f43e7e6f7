"""What is refused, what is ignored, and that either takes one clear line."""

import warnings

import pytest

from trajopt import ArgumentError, ArgumentTypeError, ModelError, ModelWarning
from trajopt.models import load_model

from .helpers import wrap

G = '<geom size=".1"/>'
TWO = (
    f'<body name="a"><freejoint/>{G}<body name="b" pos="1 0 0"><joint name="j"/>{G}'
    '<site name="s"/></body></body>'
)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (
            '<equality><connect name="loop" body1="a" body2="b" anchor="0 0 0"/></equality>',
            r"equality constraint 'loop' \(connect of 'a' and 'b'\)",
        ),
        ('<equality><joint name="lock" joint1="j"/></equality>', r"'lock' \(joint of 'j'\)"),
        (
            '<tendon><fixed name="t" range="0 1" limited="true"><joint joint="j" coef="1"/></fixed>'
            "</tendon>",
            "tendon 't' has limits",
        ),
        (
            '<tendon><fixed name="t" stiffness="3"><joint joint="j" coef="1"/></fixed></tendon>',
            "tendon 't' has a spring",
        ),
        (
            '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>'
            '<actuator><motor name="pull" tendon="t"/></actuator>',
            "actuator 'pull' acts on a tendon",
        ),
        ('<actuator><general name="jet" site="s"/></actuator>', "actuator 'jet' acts on a site"),
    ],
)
def test_refused_elements_are_named(mjcf, extra, message):
    with pytest.raises(ModelError, match=message) as error:
        mjcf(TWO, extra)
    assert "\n" not in str(error.value)


def test_flexible_bodies_are_refused(mjcf):
    cloth = (
        '<body name="frame"><flexcomp name="cloth" type="grid" dim="2" count="3 3 1"'
        ' spacing=".1 .1 .1" mass="1"/></body>'
    )
    with pytest.raises(ModelError, match="flex 'cloth' cannot be represented"):
        mjcf(cloth)


def test_harmless_elements_make_one_line(mjcf):
    extra = (
        '<equality><connect name="off" active="false" body1="a" body2="b" anchor="0 0 0"/>'
        '</equality><sensor><gyro name="gyro" site="s"/></sensor>'
        '<tendon><fixed name="idle"><joint joint="j" coef="1"/></fixed></tendon>'
        '<actuator><position name="servo" joint="j" kp="3"/></actuator>'
    )
    body = TWO.replace('name="j"', 'name="j" damping="1" armature=".1" stiffness="2"')
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mjcf(body, extra)
    assert len(caught) == 1
    assert issubclass(caught[0].category, ModelWarning)
    text = str(caught[0].message)
    assert "\n" not in text
    for phrase in (
        "damping and armature of joint j",
        "springs of joint j",
        "inactive equality off",
        "sensor gyro",
        "tendon idle",
        "gains and force ranges of actuator servo",
    ):
        assert phrase in text


def test_clean_models_are_silent(mjcf):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mjcf(TWO + '<geom type="plane" size="1 1 1"/><light/><camera/>')


def test_scenery_is_left_out_with_a_warning(mjcf):
    wall = '<geom name="wall" type="box" size="1 1 1"/>'
    with pytest.warns(ModelWarning, match=r"scenery left out.*wall \(box\)"):
        mjcf(TWO + wall)


def test_a_ball_with_a_limit_says_so(mjcf):
    ball = f'<body><joint name="neck" type="ball" limited="true" range="0 1"/>{G}</body>'
    with pytest.warns(ModelWarning, match="limits of ball joints neck"):
        mjcf(ball)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco><worldbody>", "not well-formed XML"),
        ("<mujoco><worldbody><what/></worldbody></mujoco>", "unrecognized element"),
        ("<html/>", "root element is <html>"),
        ("", "not well-formed XML"),
        (wrap(""), "nothing moves"),
        (wrap(G), "nothing moves"),
        (wrap('<body><freejoint/><geom size="1" mass="0"/></body>'), "have no mass"),
        (wrap('<body><freejoint/><site name="s"/></body>'), "have no mass"),
        (wrap(f'<body><joint limited="true"/>{G}</body>'), "range"),
        (wrap(f'<body pos="0 nan 0"><joint/>{G}</body>'), r"pos='0 nan 0' of <body> holds NaN"),
        (wrap('<body><joint/><geom name="g" size="1e300"/></body>'), "model"),
        (
            wrap(f'<body name="a" pos="1e300 0 0"><joint/>{G}</body>'),
            "pos of body a holds 1e\\+300",
        ),
    ],
)
def test_bad_files_give_one_clear_line(load_text, text, message):
    with pytest.raises(ModelError, match=message) as error:
        load_text(text)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("model.xml: ")


def test_missing_files_and_unknown_names(tmp_path):
    with pytest.raises(ModelError, match=r"nowhere\.xml: no such file"):
        load_model(tmp_path / "nowhere.xml")
    with pytest.raises(ModelError, match=r"no built-in model is named 'unicorn'; known: .*mammal"):
        load_model("unicorn")
    with pytest.raises(ModelError, match="is a folder"):
        load_model(tmp_path)
    with pytest.raises(ArgumentTypeError, match="not int"):
        load_model(3)
    with pytest.raises(ArgumentError, match="base must be one of auto, floating, fixed"):
        load_model("chain", base="free")
    with pytest.raises(ArgumentError, match="actuated must be one of"):
        load_model("chain", actuated="all")


def test_binary_file_is_not_xml(tmp_path):
    path = tmp_path / "model.xml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(ModelError, match="not well-formed"):
        load_model(path)
