"""``trajopt info``."""

from __future__ import annotations

import platform
from importlib import metadata

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
    return {
        "trajopt": version,
        "core": str(_core.__version__),
        "backends": "cpu",
        "devices": f"cpu ({platform.processor() or platform.machine()})",
        "SIMD": str(_core.isa()),
        "threads": str(_core.hardware_threads()),
        **{str(name): str(value) for name, value in build.items()},
        "Python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "scipy", "mujoco", "casadi", "matplotlib")},
    }


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
