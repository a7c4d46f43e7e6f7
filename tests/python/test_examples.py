"""Every example runs, says how it ended, and writes a trajectory."""

from __future__ import annotations

from pathlib import Path

import pytest

import trajopt
from scripts import run_script

FOLDER = Path(__file__).parents[2] / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("[!_]*.py"))


@pytest.mark.parametrize("name", SCRIPTS)
def test_example(name: str, tmp_path: Path) -> None:
    out = run_script(FOLDER / name, "--quick", "--threads", "1", "--out", tmp_path, cwd=tmp_path)
    (path,) = tmp_path.glob("*.npz")
    solution = trajopt.Solution.load(path)
    assert f"{solution.status}: {solution.message}" in out
    assert solution.frame_violation.max() < 1e-6 * solution.body_weight


def test_all_are_there() -> None:
    assert {"walk.py", "hop.py", "refine.py", "urdf_robot.py"} <= set(SCRIPTS)
