"""Choosing a device, and what is said where there is no GPU. Nothing here needs one."""

from __future__ import annotations

import doctest
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trajopt
from trajopt import _core
from trajopt.cli import info
from trajopt.devices import choose_device
from trajopt.linalg import SymmetricBlockTridiagonal

MATRIX = SymmetricBlockTridiagonal(np.tile(4.0 * np.eye(2), (3, 1, 1)), np.zeros((2, 2, 2)))


def pretend(monkeypatch, reason):
    monkeypatch.setattr(_core, "cuda_unavailable", lambda: reason)


def test_cpu_needs_no_gpu(monkeypatch):
    pretend(monkeypatch, "the moon is full")
    assert choose_device("cpu") == "cpu"
    assert choose_device("auto") == "cpu"
    assert MATRIX.factor(device="auto").device == "cpu"


def test_cuda_without_a_gpu_says_why(monkeypatch):
    pretend(monkeypatch, "the moon is full")
    with pytest.raises(trajopt.DeviceError, match="device 'cuda': the moon is full"):
        choose_device("cuda")
    with pytest.raises(trajopt.DeviceError, match="the moon is full"):
        MATRIX.factor(device="cuda")


def test_auto_takes_the_gpu(monkeypatch):
    pretend(monkeypatch, "")
    assert choose_device("auto") == "cuda"
    assert choose_device("cuda") == "cuda"
    assert choose_device("cpu") == "cpu"


@pytest.mark.parametrize("reason", ["", "the moon is full"])
def test_threads_are_not_for_a_gpu(monkeypatch, reason):
    pretend(monkeypatch, reason)
    with pytest.raises(trajopt.ArgumentError, match="factor: threads = 2 with device = 'cuda'"):
        MATRIX.factor(device="cuda", threads=2)
    assert MATRIX.factor(device="cpu", threads=2).device == "cpu"


@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_precision_does_not_choose_the_device(monkeypatch, precision):
    asked = []

    class Recorded:
        def __init__(self, *arguments):
            asked.append(arguments)

        def factor(self, *arguments):
            pass

    pretend(monkeypatch, "")
    monkeypatch.setattr(_core, "CudaBlockFactorization", Recorded, raising=False)
    for device in ("auto", "cuda"):
        factors = MATRIX.factor(device=device, precision=precision)
        assert (factors.device, factors.precision) == ("cuda", precision)
    assert asked == 2 * [(3, 2, "auto", 2, 1, precision)]
    assert MATRIX.factor(device="cpu", precision=precision).device == "cpu"


@pytest.mark.parametrize("device", ["gpu", "", "CUDA", "cuda:1"])
def test_unknown_device(device):
    with pytest.raises(trajopt.ArgumentError, match="expected 'cpu', 'cuda' or 'auto'"):
        choose_device(device)


def test_device_error_is_a_runtime_error():
    assert issubclass(trajopt.DeviceError, RuntimeError)
    assert issubclass(trajopt.DeviceError, trajopt.TrajoptError)


def test_a_reason_exactly_where_there_is_no_gpu():
    assert bool(_core.cuda_devices()) == (_core.cuda_unavailable() == "")


def test_without_visible_devices():
    """The whole way through the core, on any machine: the driver is told to show no GPU."""
    code = (
        "import numpy as np, trajopt\n"
        "from trajopt import _core\n"
        "S = trajopt.linalg.SymmetricBlockTridiagonal(np.ones((1, 1, 1)), np.ones((0, 1, 1)))\n"
        "try:\n"
        "    S.factor(device='cuda')\n"
        "except trajopt.DeviceError as error:\n"
        "    print(error)\n"
        "if _core.cuda_build() is not None:\n"
        "    try:\n"
        "        _core.CudaBlockFactorization(1, 1, 'auto', 2, 1)\n"
        "    except trajopt.DeviceError as error:\n"
        "        print(error)\n"
        "    else:\n"
        "        print('made')\n"
    )
    environment = {**os.environ, "CUDA_VISIBLE_DEVICES": ""}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    lines = done.stdout.splitlines()
    if _core.cuda_build() is None:
        assert len(lines) == 1
        assert "built without CUDA" in lines[0]
        assert "TRAJOPT_CUDA=ON" in lines[0]
    else:
        assert len(lines) == 2
        for line, start in zip(lines, ("device 'cuda': ", "no CUDA device: "), strict=True):
            assert line.startswith(start)
            assert "no NVIDIA driver" in line or "finds no GPU" in line


def test_info_with_and_without_cuda(monkeypatch, capsys):
    gpu = {
        "name": "Abacus 3000",
        "compute_capability": (9, 0),
        "multiprocessors": 132,
        "memory": 139 * 2**30,
    }
    build = {"toolkit": "13.0.88", "architectures": "80-real 90-virtual"}
    monkeypatch.setattr(_core, "cuda_build", lambda: build)
    monkeypatch.setattr(_core, "cuda_devices", lambda: [gpu])
    info.info()
    out = capsys.readouterr().out
    assert "cuda 0 (Abacus 3000, compute capability 9.0, 132 multiprocessors, 139 GiB)" in out
    assert "toolkit 13.0.88, compiled for 80-real 90-virtual" in out
    assert "GPU  " not in out

    monkeypatch.setattr(_core, "cuda_build", lambda: None)
    monkeypatch.setattr(_core, "cuda_devices", list)
    pretend(monkeypatch, "the moon is full")
    info.info()
    facts = dict(line.split(None, 1) for line in capsys.readouterr().out.splitlines())
    assert facts["backends"] == "cpu"
    assert facts["CUDA"] == "not compiled in"
    assert facts["GPU"] == "none: the moon is full"


def test_examples_of_the_documentation():
    page = Path(__file__).parents[2] / "docs" / "cuda.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert tried > 0
    assert failed == 0
