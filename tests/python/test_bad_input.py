"""Bad input through the command line: one clear line, exit code 2, no traceback."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import trajopt
from trajopt.cli import main

SCENARIO = """
[model]
{model}

[grid]
duration = 0.5
dt = {dt}
{grid}

{extra}

[[objective]]
type = "{kind}"
weight = {weight}
"""

MASSLESS = """<mujoco><worldbody><body><freejoint/>
<geom type="sphere" size=".1" mass="0"/></body></worldbody></mujoco>"""


def scenario(folder: Path, **changes: str) -> Path:
    entries = {
        "model": 'name = "chain"',
        "dt": "0.025",
        "grid": "",
        "extra": "",
        "kind": "control_effort",
        "weight": "1.0",
        **changes,
    }
    path = folder / "mine.toml"
    path.write_text(SCENARIO.format(**entries))
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    code = main([str(a) for a in arguments])
    return code, capsys.readouterr().err


MISTAKES = {
    "unknown objective type": ({"kind": "fly"}, "fly"),
    "dt of zero": ({"dt": "0.0"}, "dt must be a number > 0"),
    "negative dt": ({"dt": "-0.1"}, "dt must be a number > 0"),
    "dt that is not a number": ({"dt": "nan"}, "dt"),
    "dt larger than the duration": ({"dt": "2.0"}, "must be a multiple of dt = 2 s"),
    "frames not a multiple": (
        {"grid": 'formulation = "spline"\nframes_per_knot = 7'},
        "20 frames (duration / dt) must be a multiple of frames_per_knot = 7",
    ),
    "unknown key": ({"grid": "durration = 3"}, "durration"),
    "unknown section": ({"extra": "[gird]\ndt = 1"}, "gird"),
    "all weights zero": ({"weight": "0.0"}, "no objective term with a weight > 0"),
    "negative weight": ({"weight": "-1.0"}, "weight must be >= 0, not -1.0"),
    "negative stiffness": (
        {"extra": "[contact]\nnormal = -5.0"},
        "mine.toml: [contact]: normal must be >= 0, not -5.0",
    ),
    "negative limit": ({"grid": "limit = -1.0"}, "limit must be >= 0"),
    "friction without normal": (
        {"extra": "[contact]\nnormal = 0.0\nfriction = 5.0"},
        "friction = 5 needs a normal stiffness > 0",
    ),
    "pose with NaN": (
        {"extra": "[initial]\npose = [" + "nan, " * 14 + "]"},
        "mine.toml: [initial]: pose[0] = nan",
    ),
    "pose of wrong shape": (
        {"extra": "[initial]\npose = [0.0, 1.0]"},
        "mine.toml: [initial]: pose has shape (2,), expected (14,)",
    ),
    "pose that names nobody": (
        {"extra": "[initial.pose]\nwing = 1.0"},
        "mine.toml: [initial]: pose names 'wing'",
    ),
    "velocity of wrong shape": (
        {"extra": "[initial]\nvelocity = [0.0, 1.0]"},
        "mine.toml: [initial]: velocity has shape (2,), expected (14,)",
    ),
    "velocity that names nobody": (
        {"extra": "[initial.velocity]\nwing = 1.0"},
        "mine.toml: [initial]: velocity names 'wing', but the model's coordinates are root_tx",
    ),
    "velocity that is no number": (
        {"extra": "[initial.velocity]\nroot_tx = 'fast'"},
        "mine.toml: [initial]: velocity of root_tx must be a number, not str 'fast'",
    ),
    "velocity by a word": (
        {"extra": "[initial]\nvelocity = 'fast'"},
        "mine.toml: [initial]: velocity must be an array or values by name, not 'fast'",
    ),
    "negative height": ({"extra": "[initial]\nheight = -1"}, "[initial]: height must be >= 0"),
    "height without ground": (
        {"extra": "[initial]\nheight = 1\n[world]\nobstacles = []"},
        "mine.toml: [initial]: height = 1 needs a model with",
    ),
    "unknown model": ({"model": 'name = "chian"'}, "chian"),
    "missing model file": ({"model": 'file = "nowhere.xml"'}, "nowhere.xml"),
    "malformed model": ({"model": 'file = "broken.xml"'}, "broken.xml"),
    "model without mass": ({"model": 'file = "massless.xml"'}, "mass"),
    "unknown method": (
        {"extra": '[solver]\nmethod = "magic"'},
        "[solver]: method = 'magic', expected one",
    ),
    "unknown ordering": ({"extra": '[solver]\nordering = "any"'}, "ordering = 'any', expected"),
    "device of a scenario": (
        {"extra": '[solver]\ndevice = "cuda"'},
        "unknown key in [solver] 'device'",
    ),
    "threads of a scenario": (
        {"extra": "[solver]\nthreads = 2"},
        "unknown key in [solver] 'threads'",
    ),
    "no iterations": (
        {"extra": "[solver]\nmax_iterations = 0"},
        "[solver]: max_iterations must be a whole",
    ),
    "bad seed": ({"extra": "[solver]\nseed = -1"}, "[solver]: seed must be a whole number >= 0"),
    "bad factor": (
        {"extra": "[solver]\n[[solver.stages]]\nfactors = { effort = -1.0 }"},
        "[[solver.stages]] 1: factors['effort'] must be >= 0",
    ),
    "no such term": (
        {"extra": "[solver]\n[[solver.stages]]\nfactors = { effort = 1.0 }"},
        "mine.toml: [solver]: stages[0]: factors names 'effort', which is no term of the objective",
    ),
    "bad stage": ({"extra": "[solver]\n[[solver.stages]]\nstiffness = 0"}, "stiffness must be > 0"),
    "unknown integrator": ({"grid": 'integrator = "rk4"'}, "integrator = 'rk4', expected one of"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_a_scenario(
    mistake: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    changes, message = MISTAKES[mistake]
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody>")
    (tmp_path / "massless.xml").write_text(MASSLESS)
    path = scenario(tmp_path, **changes)
    code, err = run(capsys, "solve", path, "--out", tmp_path / "out.npz", "--quiet")
    assert code == 2, err
    lines = [line for line in err.splitlines() if not line.startswith("warning:")]
    assert len(lines) == 1
    assert lines[0].startswith("error: ")
    assert message in lines[0]
    assert "Traceback" not in err
    assert not (tmp_path / "out.npz").exists()


TERMS = {
    "position of wrong shape": (
        "center_of_mass_position",
        "position = [[1, 0], [2, 0], [3, 0]]\ntime = [0.1, 0.2, 0.3]",
        "position has shape (3, 2), expected (n, 3)",
    ),
    "NaN": ("center_of_mass_velocity", "velocity = [nan, 0, 0]", "velocity[0] = nan, expected"),
    "time after the end": (
        "center_of_mass_position",
        "position = [1, 0, 0]\ntime = 0.7",
        "time = 0.7 s lies outside the motion, which lasts from 0 to 0.5 s",
    ),
    "keyframes without times": ("pose", f"pose = [{[0.0] * 14}, {[0.0] * 14}]", "2 poses need as"),
    "keyframes of the same frame": (
        "center_of_mass_position",
        "position = [[1, 0, 0], [2, 0, 0]]\ntime = [0.3, 0.301]",
        "2 positions fall on 1 frames",
    ),
    "start after the end": (
        "center_of_mass_velocity",
        "velocity = [1, 0, 0]\nstart = 2.0",
        "start = 2 s lies behind the end at 0.5 s",
    ),
    "unknown body": (
        "point_position",
        'body = "wing"\nposition = [0, 0, 1]',
        "no body is called 'wing'; the model has",
    ),
    "unknown coordinate": ("pose", 'dofs = ["tail"]', "no coordinate is called 'tail'"),
    "a word for numbers": ("point_velocity", 'body = "link1"\nvelocity = "fast"', "velocity must"),
    "axes of wrong shape": (
        "center_of_mass_velocity",
        "velocity = [1, 0, 0]\naxes = [1, 1]",
        "axes has shape (2,), expected (3,)",
    ),
}


@pytest.mark.parametrize("mistake", TERMS)
def test_mistakes_in_terms_name_file_and_section(
    mistake: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    kind, text, message = TERMS[mistake]
    path = scenario(tmp_path)
    path.write_text(path.read_text() + f'[[objective]]\ntype = "{kind}"\n{text}\n')
    with pytest.raises(trajopt.TrajoptError):  # before anything is solved
        trajopt.load_scenario(path).build()
    code, err = run(capsys, "solve", path, "--out", tmp_path / "out.npz", "--quiet")
    assert code == 2, err
    assert err.startswith(f"error: mine.toml: [[objective]] 2 ({kind}): {message}")
    assert err.count("\n") == 1


def test_a_term_without_what_it_needs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = scenario(tmp_path, kind="center_of_mass_velocity")
    code, err = run(capsys, "solve", path)
    line = "error: mine.toml: [[objective]] 1 (center_of_mass_velocity) needs the key 'velocity'"
    assert (code, err) == (2, line + "\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("solve", "hopp"), "did you mean 'hop'?"),
        (("solve", "nowhere.toml"), "nowhere.toml"),
        (("solve", "hop", "--threads", "0"), "threads must be a whole number >= 1, not 0"),
        (("solve", "hop", "--max-iterations", "0"), "max_iterations must be a whole number >= 1"),
        (("solve", "hop", "--method", "magic"), "method = 'magic'"),
        (("solve", "hop", "--device", "tpu"), "device = 'tpu'"),
        (("solve", "hop", "--set", "grid.dt=-1"), "dt must be a number > 0"),
        (("solve", "hop", "--resume", "nowhere.npz"), "nowhere.npz: no such file"),
        (("check", "nowhere.urdf"), "nowhere.urdf"),
        (("plot", "nowhere.npz"), "nowhere.npz: no such file"),
    ],
)
def test_mistakes_in_the_command(
    arguments: tuple[str, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, err = run(capsys, *arguments)
    assert code == 2, err
    assert err.count("\n") == 1
    assert message in err


def test_malformed_toml(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[model\nname = 3")
    code, err = run(capsys, "solve", path)
    assert code == 2
    assert err.count("\n") == 1
    assert "mine.toml" in err


@pytest.mark.parametrize(("height", "message"), [(0.6, "m above the"), (-0.4, "m inside the")])
def test_poses_off_the_ground_warn_and_solve(
    height: float, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    name = trajopt.load_model("chain").dof_names[2]
    path = scenario(tmp_path, extra=f"[initial.pose]\n{name} = {height}")
    out = tmp_path / "out.npz"
    code, err = run(capsys, "solve", path, "--out", out, "--quiet", "--max-iterations", "30")
    assert code in (0, 1)
    (line,) = err.splitlines()
    assert line.startswith("warning: initial pose: the lowest contact point lies")
    assert message in line
    assert np.isfinite(trajopt.Solution.load(out).x).all()
