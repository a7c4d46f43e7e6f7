"""Every collocation example runs, prints its figures, and writes solutions and pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts import run_script
from trajopt import collocation as col

FOLDER = Path(__file__).parents[3] / "examples" / "collocation"
EXPECTED = {
    "block_move.py": ["objective 12.07496136", "objective 12.00000000"],
    "block_move_work.py": ["1.270166537926", "1.26452", "1.19378", "0.71167", "infeasible"],
    "cart_pole.py": ["objective 58.80542547", "objective 60.03551947", "57.93870920"],
    "five_link_biped.py": ["390.79043", "469.5010", "392.889", "456.188"],
}


def test_all_are_covered() -> None:
    assert {path.name for path in FOLDER.glob("[!_]*.py")} == set(EXPECTED)


@pytest.mark.parametrize("name", EXPECTED)
def test_example(name: str, tmp_path: Path) -> None:
    out = run_script(FOLDER / name, "--out", tmp_path, cwd=tmp_path)
    for words in EXPECTED[name]:
        assert words in out
    (path,) = tmp_path.glob("*.npz")
    assert col.Solution.load(path).converged
    assert len(list(tmp_path.glob("*.png"))) >= 2
