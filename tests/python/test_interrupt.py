"""Ctrl-C, once or many times, costs no motion: the best one is in its file, whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import trajopt
from trajopt.interrupt import InterruptFlag

SCENARIO = ["--set", "grid.duration=2", "--set", "solver.tolerance=1e-13", "--threads", "1"]

# Writes as slowly as a disk that is nearly full, and says when it does.
SLOW = """
import os, sys, time
flush = os.fsync
def slow(file):
    print("writing", flush=True)
    time.sleep(0.6)
    flush(file)
os.fsync = slow
from trajopt.cli import main
sys.exit(main(sys.argv[1:]))
"""


def press(process: subprocess.Popen[str], target: Path) -> int:
    """Press Ctrl-C until `target` is there; return how often."""
    times = 0
    deadline = time.monotonic() + 60.0
    while not target.exists() and process.poll() is None:
        assert time.monotonic() < deadline
        process.send_signal(signal.SIGINT)
        times += 1
        time.sleep(0.02)
    return times


def start(*command: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *map(str, command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def test_impatience_costs_nothing(tmp_path: Path) -> None:
    target = tmp_path / "walk.npz"
    process = start("-c", SLOW, "solve", "mammal-walk", "--out", target, *SCENARIO)
    assert process.stderr is not None
    lines = [process.stderr.readline() for _ in range(2)]  # the header, the first iteration
    assert "objective" in lines[0]
    times = press(process, target)
    out, err = process.communicate()
    assert times >= 3
    assert process.returncode == 1, err
    assert err.count(f"stopping after this iteration, to write {target}") == 1
    assert "Traceback" not in err
    assert out.startswith("writing\ninterrupted: ")
    assert [path.name for path in tmp_path.iterdir()] == ["walk.npz"]
    solution = trajopt.Solution.load(target)
    assert solution.status == "interrupted"
    assert solution.frames == 80
    assert solution.iterations == len(solution.history) > 0


def test_control_c_while_writing(tmp_path: Path) -> None:
    target = tmp_path / "walk.npz"
    process = start(
        "-c", SLOW, "solve", "mammal-walk", "--out", target, "--quiet", *SCENARIO,
        "--max-iterations", "3",
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    assert not target.exists()
    for _ in range(4):
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)
    out, err = process.communicate()
    assert process.returncode == 1, err
    assert "Traceback" not in err
    assert f"written: {target}" in out
    assert [path.name for path in tmp_path.iterdir()] == ["walk.npz"]
    assert trajopt.Solution.load(target).iterations == 3


@pytest.fixture
def control_c():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda: os.kill(os.getpid(), signal.SIGINT)
    signal.signal(signal.SIGINT, before)


def test_the_third_raises(control_c) -> None:
    with InterruptFlag() as flag:
        assert not flag.raised
        control_c()
        control_c()
        assert flag.raised
        with pytest.raises(KeyboardInterrupt):
            control_c()
    with pytest.raises(KeyboardInterrupt):
        control_c()


def test_flags_within_one_another(control_c, capfd) -> None:
    with InterruptFlag(insist=False, note="stopping") as outer:
        with InterruptFlag() as inner:
            for _ in range(5):
                control_c()
            assert inner.raised
            assert outer.raised
        with InterruptFlag() as late:
            assert late.raised
        control_c()
    assert capfd.readouterr().err == "stopping\n"
