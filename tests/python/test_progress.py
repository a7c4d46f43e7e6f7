from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import trajopt
from synthetic import history, motion
from trajopt.progress import CheckpointWriter, LinePrinter, LivePrinter, chain, printer
from trajopt.records import IterationRecord


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_records_survive_a_dict() -> None:
    for record in history(5):
        assert IterationRecord.from_dict(record.to_dict()) == record


def test_fields_of_newer_versions_are_ignored() -> None:
    assert IterationRecord.from_dict({"iteration": 2, "colour": "red"}) == IterationRecord(2)


def test_lines_show_every_kth_iteration_new_stages_and_the_last() -> None:
    stream = io.StringIO()
    records = [IterationRecord(k, stage=int(k > 24)) for k in range(38)]
    with LinePrinter(stream, every=10) as show:
        for record in records:
            show(record)
    header, *lines = stream.getvalue().splitlines()
    assert header.split() == [
        "it",
        "stage",
        "objective",
        "frame/mg",
        "step",
        "radius",
        "λ",
        "ok",
        "s",
    ]
    assert [int(line.split()[0]) for line in lines] == [0, 10, 20, 25, 30, 37]


@pytest.mark.parametrize("kind", [LinePrinter, LivePrinter])
@pytest.mark.parametrize("every", [0, -1, 1.5])
def test_what_is_no_number_of_iterations(kind: type[LinePrinter], every: int) -> None:
    with pytest.raises(trajopt.TrajoptError, match=f"{kind.__name__}: every must be a whole"):
        kind(every=every)


def test_columns_line_up() -> None:
    stream = io.StringIO()
    with LinePrinter(stream, every=1) as show:
        for record in history(30):
            show(record)
    assert len({len(line) for line in stream.getvalue().splitlines()}) == 1


def test_terminal_gets_the_live_table(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    show = printer()
    assert isinstance(show, LivePrinter)
    with show:
        for record in history(25):
            show(record)
    assert "objective" in terminal.getvalue()
    assert isinstance(printer(io.StringIO()), LinePrinter)


def test_checkpoint_holds_the_snapshot_and_its_origin(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write = CheckpointWriter(path, every=0.0, settings={"origin": "test"})
    write(IterationRecord(1))
    assert not path.exists()
    write(replace(IterationRecord(2), snapshot=lambda: motion("chain", frames=10)))
    loaded = trajopt.Solution.load(path)
    assert loaded.frames == 10
    assert loaded.settings["origin"] == "test"


def test_checkpoints_keep_their_distance(tmp_path: Path) -> None:
    def forbidden() -> trajopt.Solution:
        raise AssertionError("too early")

    CheckpointWriter(tmp_path / "a.npz", every=60.0)(
        replace(IterationRecord(1), snapshot=forbidden)
    )


def test_chain_calls_everyone_and_stops_if_one_asks() -> None:
    seen: list[int] = []
    observe = chain(None, lambda r: r.iteration == 2, lambda r: seen.append(r.iteration))
    assert [observe(IterationRecord(k)) for k in range(4)] == [False, False, True, False]
    assert seen == [0, 1, 2, 3]
