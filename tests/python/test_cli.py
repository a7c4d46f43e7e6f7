from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trajopt
from synthetic import motion
from trajopt.cli import main

QUICK = ["--max-iterations", "3", "--set", "grid.duration=1.5"]
JSON_KEYS = {
    "status",
    "message",
    "iterations",
    "objective",
    "constraint_violation",
    "frame_violation_max",
    "frame_violation_rms",
    "fine_violation_rms",
    "body_weight",
    "seconds",
    "device",
    "ordering",
    "out",
}


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    motion("chain", frames=20).save(tmp_path / "chain.npz")
    return tmp_path / "chain.npz"


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_scenarios_in_a_pipe_are_lines_of_four_fields(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "scenarios")
    assert code == 0
    rows = [line.split("\t") for line in out.splitlines()]
    assert [row[0] for row in rows] == trajopt.list_scenarios()
    for name, character, frames, task in rows:
        scenario = trajopt.load_scenario(name)
        assert (character, int(frames)) == (scenario.character, scenario.frames)
        assert task == scenario.task


def test_scenarios_on_a_terminal_are_a_table_with_a_header(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "60")
    code, out, _ = run(capsys, "scenarios")
    assert code == 0
    out = re.sub(r"\x1b\[[0-9;]*m", "", out)
    lines = [line.split() for line in out.splitlines() if line.strip()]
    assert lines[0] == ["name", "character", "frames", "task"]
    names = [line[0] for line in lines]
    assert [name for name in names if name in trajopt.list_scenarios()] == trajopt.list_scenarios()
    assert max(map(len, out.splitlines())) <= 60
    words = {word for line in lines for word in line}
    assert set(trajopt.load_scenario("hop").task.split()) <= words


def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "info")
    assert code == 0
    names = {line.split()[0] for line in out.splitlines()}
    assert {"trajopt", "backends", "devices", "CUDA", "SIMD", "threads"} <= names


def test_check_prints_the_model_and_finds_it_good(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "check", "chain")
    assert code == 0
    assert out.rstrip().endswith("good")
    for name in (*trajopt.load_model("chain").body_names, "kg", "contact points", "order 2.0"):
        assert name in out


def test_solve_writes_a_file_and_one_json_object(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "walk.npz"
    code, out, err = run(capsys, "solve", "mammal-walk", "--out", target, "--json", *QUICK)
    figures = json.loads(out)
    assert set(figures) == JSON_KEYS
    assert err == ""
    assert figures["out"] == str(target)
    assert figures["iterations"] <= 3
    assert figures["ordering"] == "frontal"
    assert code == (0 if figures["status"] == "solved" else 1)
    solution = trajopt.Solution.load(target)
    assert str(solution.status) == figures["status"]
    assert solution.settings["scenario"]["name"] == "mammal-walk"
    assert [path.name for path in tmp_path.iterdir()] == ["walk.npz"]


def test_resume_needs_no_scenario_and_continues_the_history(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    run(capsys, "solve", "mammal-walk", "--out", first, "--quiet", *QUICK)
    code, out, _ = run(capsys, "solve", "--resume", first, "--out", second, "--quiet", *QUICK[:2])
    assert code in (0, 1)
    assert f"written: {second}" in out
    before, after = trajopt.Solution.load(first), trajopt.Solution.load(second)
    assert after.frames == before.frames
    assert len(after.history) > len(before.history)
    assert all(np.diff([r.iteration for r in after.history]) >= 0)


def test_table_goes_to_the_error_stream(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    _, out, err = run(capsys, "solve", "mammal-walk", "--out", tmp_path / "a.npz", *QUICK)
    assert "objective" in err.splitlines()[0]
    assert out.splitlines()[-1] == f"  written: {tmp_path / 'a.npz'}"


def test_plot(capsys: pytest.CaptureFixture[str], saved: Path) -> None:
    code, out, _ = run(capsys, "plot", saved)
    assert (code, out.strip()) == (0, str(saved.with_suffix(".png")))
    assert saved.with_suffix(".png").stat().st_size > 10_000
    target = saved.with_name("motion.svg")
    assert run(capsys, "plot", saved, "-o", target, "--only", "motion")[0] == 0
    assert target.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve"], "name a scenario"),
        (["solve", "hopp"], "did you mean 'hop'"),
        (["solve", "none.toml"], "no such scenario file"),
        (["solve", "hop", "--set", "grid.duratoin=1"], "did you mean 'duration'"),
        (["solve", "hop", "--set", "grid.dt=-1"], "dt must be a number > 0"),
        (["solve", "hop", "--method", "magic"], "magic"),
        (["solve", "hop", "--device", "abacus"], "abacus"),
        (["solve", "hop", "--max-iterations", "-4"], "max_iterations"),
        (["solve", "hop", "--max-iterations", "many"], "--max-iterations"),
        (["solve", "--resume", "none.npz"], "no such file"),
        (["solve", "hop", "--fast"], "--fast"),
        (["check", "dragon"], "dragon"),
        (["check", "none.xml"], "none.xml"),
        (["plot", "none.npz"], "no such file"),
        (["plot", __file__], "not a trajopt result (.npz)"),
        (["solve", "hop", "--out", "x.txt"], "--out x.txt: a trajectory is a .npz file: x.npz"),
        (["fly"], "fly"),
        ([], "ommand"),
    ],
)
def test_mistakes_give_one_line_and_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert message in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_file_that_cannot_be_written_is_code_2(
    capsys: pytest.CaptureFixture[str], saved: Path
) -> None:
    code, _, err = run(capsys, "plot", saved, "-o", saved / "inside-a-file.png")
    assert code == 2
    assert err.count("\n") == 1


def test_defects_give_one_line_and_code_3(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, saved: Path
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("trajopt.plotting.plot_solution", broken)
    code, _, err = run(capsys, "plot", saved)
    assert (code, err.count("\n")) == (3, 1)
    assert "internal error: ZeroDivisionError: a bug" in err
    assert "TRAJOPT_TRACEBACK=1" in err
    monkeypatch.setenv("TRAJOPT_TRACEBACK", "1")
    assert "Traceback" in run(capsys, "plot", saved)[2]


def test_exit_codes_reach_the_shell() -> None:
    command = [sys.executable, "-m", "trajopt"]
    assert subprocess.run([*command, "scenarios"], capture_output=True, check=False).returncode == 0
    bad = subprocess.run([*command, "solve", "hopp"], capture_output=True, check=False)
    assert bad.returncode == 2
    assert bad.stderr.startswith(b"error: unknown scenario 'hopp'")


def test_warnings_are_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, saved: Path
) -> None:
    import warnings

    def warned(*_: object) -> None:
        warnings.warn("the ground is far away", stacklevel=1)

    monkeypatch.setattr("trajopt.plotting.plot_solution", warned)
    assert run(capsys, "plot", saved)[2] == "warning: the ground is far away\n"


def test_help_names_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--help")
    assert code == 0
    assert all(command in out for command in ("solve", "scenarios", "check", "plot", "info"))


def test_help_of_solve_names_the_methods_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "solve", "--help")[1]
    assert "default or paper" in " ".join(out.split())


def test_resume_without_a_scenario_names_the_file(
    capsys: pytest.CaptureFixture[str], saved: Path
) -> None:
    solution = trajopt.Solution.load(saved)
    solution.settings = {}
    solution.save(saved)
    code, _, err = run(capsys, "solve", "--resume", saved)
    assert code == 2
    assert f"{saved}: does not say" in err


def test_report_says_what_is_left_of_each_term_and_warns_of_rough_physics(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    coarse = ("--set", "grid.dt=0.1", "--quiet", "--out", tmp_path / "hop.npz")
    _, out, _ = run(capsys, "solve", "hop", *coarse)
    assert "center_of_mass_position" in out
    assert "rough between frames" in out
