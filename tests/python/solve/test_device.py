"""`solve(device=...)`: what it accepts and refuses. Nothing here needs a GPU."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt import _core
from trajopt.cli import main
from trajopt.objectives import CenterOfMassVelocity, regularizers

CHAIN = trajopt.load_model("chain")


def make(**changes):
    problem = trajopt.Problem(CHAIN, **{"duration": 0.5, "dt": 0.05, **changes})
    return problem.add(CenterOfMassVelocity((0.3, 0, 0), start=0.2), *regularizers())


def pretend(monkeypatch, reason):
    monkeypatch.setattr(_core, "cuda_unavailable", lambda: reason)


def refusal(problem, **options):
    with pytest.raises(trajopt.DeviceError) as caught:
        trajopt.solve(problem, device="cuda", max_iterations=1, **options)
    return str(caught.value)


def test_without_a_gpu_nothing_begins(monkeypatch):
    pretend(monkeypatch, "the moon is full")
    monkeypatch.setattr("trajopt.run.Transcription", None)
    assert refusal(make()) == "device 'cuda': the moon is full"


def test_the_paper_runs_on_the_cpu(monkeypatch):
    pretend(monkeypatch, "")
    monkeypatch.setattr("trajopt.run.Transcription", None)
    assert refusal(make(), method="paper").startswith("solve: method 'paper' runs on the CPU only")


@pytest.mark.parametrize("reason", ["", "the moon is full"])
def test_threads_are_not_for_a_gpu(monkeypatch, reason):
    """Said first: leaving them out is what the caller has to do with a GPU or without."""
    pretend(monkeypatch, reason)
    monkeypatch.setattr("trajopt.run.Transcription", None)
    expected = "threads = 4 with device = 'cuda', expected no threads: they are the processor's"
    for owner, call in (
        ("solve", lambda **options: trajopt.solve(make(), **options)),
        ("solve_batch", lambda **options: trajopt.solve_batch([make()], **options)),
    ):
        with pytest.raises(trajopt.ArgumentError) as caught:
            call(device="cuda", threads=4)
        assert str(caught.value) == f"{owner}: {expected}"
        with pytest.raises(trajopt.ArgumentError, match="threads must be a whole number"):
            call(device="cuda", threads=0)


def test_threads_are_not_for_a_gpu_on_the_command_line(monkeypatch, capsys):
    pretend(monkeypatch, "")
    assert main(["solve", "hop", "--device", "cuda", "--threads", "2"]) == 2
    assert "threads = 2 with device = 'cuda'" in capsys.readouterr().err


def test_an_executor_chooses_no_threads_for_a_gpu(monkeypatch):
    pretend(monkeypatch, "")
    given = []

    class Keeps:
        def submit(self, function, problem, options):
            given.append(options)
            raise RuntimeError("kept")

    for device in ("cuda", "cpu"):
        with pytest.raises(trajopt.BatchError, match="kept"):
            trajopt.solve_batch([make()], device=device, executor=Keeps())
    assert [(o["device"], o["threads"]) for o in given] == [("cuda", None), ("cpu", 1)]


def test_auto_is_the_cpu(monkeypatch):
    pretend(monkeypatch, "")
    found = [
        trajopt.solve(make(), device=device, max_iterations=2, threads=1)
        for device in ("auto", "cpu")
    ]
    assert [s.device for s in found] == ["cpu", "cpu"]
    np.testing.assert_array_equal(found[0].x, found[1].x)
