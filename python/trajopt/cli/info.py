"""``trajopt info``."""

from __future__ import annotations

import platform
from importlib import metadata
from typing import Any

import typer

__all__ = ["info"]


def info() -> None:
    """Print version, backends, devices, instruction set, threads and build options."""
    import trajopt

    for name, value in _facts(trajopt.__version__).items():
        typer.echo(f"{name:<13} {value}")


def _facts(version: str) -> dict[str, str]:
    from trajopt import _core

    build: dict[str, object] = getattr(_core, "build_info", dict)()
    cuda = _core.cuda_build()
    gpus = [_gpu(number, gpu) for number, gpu in enumerate(_core.cuda_devices())]
    return {
        "trajopt": version,
        "core": str(_core.__version__),
        "backends": "cpu" if cuda is None else "cpu, cuda",
        "devices": "; ".join([f"cpu ({platform.processor() or platform.machine()})", *gpus]),
        "CUDA": (
            "not compiled in"
            if cuda is None
            else f"toolkit {cuda['toolkit']}, compiled for {cuda['architectures']}"
        ),
        **({} if gpus else {"GPU": f"none: {_core.cuda_unavailable()}"}),
        "SIMD": str(_core.isa()),
        "threads": str(_core.hardware_threads()),
        **{str(name): str(value) for name, value in build.items()},
        "Python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "scipy", "mujoco", "casadi", "matplotlib")},
    }


def _gpu(number: int, gpu: dict[str, Any]) -> str:
    major, minor = gpu["compute_capability"]
    return (
        f"cuda {number} ({gpu['name']}, compute capability {major}.{minor}, "
        f"{gpu['multiprocessors']} multiprocessors, {gpu['memory'] / 2**30:.0f} GiB)"
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
