"""Every example runs, says how it ended, and writes a trajectory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import trajopt

FOLDER = Path(__file__).parents[2] / "examples"
SCRIPTS = sorted(path.name for path in FOLDER.glob("[!_]*.py"))


@pytest.mark.parametrize("name", SCRIPTS)
def test_example(name: str, tmp_path: Path) -> None:
    run = subprocess.run(
        [
            sys.executable,
            str(FOLDER / name),
            "--quick",
            *("--threads", "1"),
            *("--out", str(tmp_path)),
        ],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    (path,) = tmp_path.glob("*.npz")
    solution = trajopt.Solution.load(path)
    assert f"{solution.status}: {solution.message}" in run.stdout
    assert solution.frame_violation.max() < 1e-6 * solution.body_weight


def test_all_are_there() -> None:
    assert {"walk.py", "hop.py", "refine.py", "urdf_robot.py"} <= set(SCRIPTS)
