from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

import trajopt
from synthetic import motion
from trajopt.storage import ARRAYS, SCALARS, write_atomically


@pytest.fixture(scope="module")
def solution() -> trajopt.Solution:
    return motion("chain", frames=20)


def test_everything_survives_a_file(solution: trajopt.Solution, tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "chain.npz"
    solution.save(path)
    loaded = trajopt.Solution.load(path)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(solution, name))
    for name in SCALARS:
        assert getattr(loaded, name) == getattr(solution, name), name
    assert loaded.status is trajopt.Status.SOLVED
    assert isinstance(loaded.dt, float)
    assert loaded.world == solution.world
    assert loaded.contact == solution.contact
    assert [r.to_dict() for r in loaded.history] == [r.to_dict() for r in solution.history]
    for name, value in solution.model.to_dict().items():
        np.testing.assert_array_equal(loaded.model.to_dict()[name], value)


def test_steps_that_differ_survive_a_file(tmp_path: Path) -> None:
    solution = motion("chain", frames=20)
    solution.dt = np.linspace(0.01, 0.03, 20)
    solution.save(tmp_path / "a.npz")
    np.testing.assert_array_equal(trajopt.Solution.load(tmp_path / "a.npz").dt, solution.dt)


def test_file_holds_what_the_format_promises(solution: trajopt.Solution, tmp_path: Path) -> None:
    solution.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        assert set(archive.files) >= {"x", "u", "times", "control_points", "dt", "model", "status"}
        assert str(archive["model"]).lstrip().startswith("<mujoco")
        assert str(archive["status"]) == "solved"


def test_figures_that_are_not_known_are_null_in_json() -> None:
    solution = motion("chain", frames=20)
    solution.fine_violation = np.zeros(0)
    summary = solution.summary()
    assert summary["fine_violation_rms"] is None
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["frame_violation_max"] == pytest.approx(
        solution.frame_violation.max() / solution.body_weight
    )


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(trajopt.FileFormatError, match="no such file"):
        trajopt.Solution.load(tmp_path / "nothing.npz")


def test_foreign_files(tmp_path: Path) -> None:
    text, archive = tmp_path / "text.npz", tmp_path / "archive.npz"
    text.write_text("x,y\n1,2\n")
    np.savez(archive, x=np.zeros(3))
    with pytest.raises(trajopt.FileFormatError, match=r"not a trajopt result"):
        trajopt.Solution.load(text)
    with pytest.raises(trajopt.FileFormatError, match="not a trajectory of trajopt"):
        trajopt.Solution.load(archive)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_cut_off_file(solution: trajopt.Solution, tmp_path: Path, share: float) -> None:
    path = tmp_path / "a.npz"
    solution.save(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(trajopt.FileFormatError, match=r"a\.npz"):
        trajopt.Solution.load(path)


@pytest.mark.parametrize("lost", ["x", "model", "info", "model.home"])
def test_file_without_an_entry(solution: trajopt.Solution, tmp_path: Path, lost: str) -> None:
    path, damaged = tmp_path / "a.npz", tmp_path / "b.npz"
    solution.save(path)
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(damaged, "w") as target:
        for name in source.namelist():
            if name != f"{lost}.npy":
                target.writestr(name, source.read(name))
    with pytest.raises(trajopt.FileFormatError, match=lost.split(".")[-1]):
        trajopt.Solution.load(damaged)


def test_loading_never_unpickles(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return (pytest.fail, ("code in the file was executed",))

    path = tmp_path / "trap.npz"
    np.savez(path, format="trajopt-trajectory", x=np.array([Trap()], dtype=object))
    with pytest.raises(trajopt.FileFormatError):
        trajopt.Solution.load(path)


def test_world_of_a_file_cannot_name_other_classes() -> None:
    from trajopt.storage import restore

    with pytest.raises(ValueError, match="unknown part of a world"):
        restore({"type": "annotations"})


def test_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    write_atomically(path, lambda file: file.write(b"old"))

    def broken(file: object) -> None:
        raise RuntimeError("disk full")

    with pytest.raises(RuntimeError, match="disk full"):
        write_atomically(path, broken)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("status", list(trajopt.Status))
def test_every_status_says_what_it_means(status: trajopt.Status) -> None:
    assert status.meaning
    assert "\n" not in status.meaning
    assert status.converged == (status == "solved")
