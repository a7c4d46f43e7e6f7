"""`solve(device=...)`: what it accepts and refuses. Nothing here needs a GPU."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt import _core
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


def test_auto_is_the_cpu(monkeypatch):
    pretend(monkeypatch, "")
    found = [
        trajopt.solve(make(), device=device, max_iterations=2, threads=1)
        for device in ("auto", "cpu")
    ]
    assert [s.device for s in found] == ["cpu", "cpu"]
    np.testing.assert_array_equal(found[0].x, found[1].x)
