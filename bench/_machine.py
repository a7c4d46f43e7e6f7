"""What a measurement was made on and with, and results files that are always whole."""

from __future__ import annotations

import datetime
import hashlib
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import trajopt
from trajopt import _core
from trajopt.storage import write_atomically

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "bench" / "results"
NAMES = ("hop", "chain-jump", "mammal-walk", "biped-walk")  # as tables and pictures show them


def environment() -> dict[str, Any]:
    """Hardware, date and versions."""
    return {
        "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d"),
        "cpu": _cpu_name(),
        "cores": len(os.sched_getaffinity(0)),
        "isa": _core.isa(),
        "system": f"{platform.system()} {platform.machine()}",
        "trajopt": trajopt.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def describe(machine: dict[str, Any]) -> str:
    """One line for tables and plots."""
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['isa']}, {machine['system']}; "
        f"trajopt {machine['trajopt']}, Python {machine['python']}, {machine['date']}"
    )


def fingerprint(settings: Any) -> str:
    """Short hash of a scenario's settings and of the code that solves and audits it.

    Solver, core and characters count; plots and the command line do not.
    """
    package = Path(trajopt.__file__).parent
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for path in sorted(package.rglob("*")):
        place = path.relative_to(package)
        if path.suffix in (".py", ".so", ".xml") and place.parts[0] not in ("cli", "plotting"):
            digest.update(str(place).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def read(path: Path) -> dict[str, Any]:
    """Results written before, or none."""
    return dict(json.loads(path.read_text())) if path.exists() else {}


def in_order(results: dict[str, Any]) -> dict[str, Any]:
    """The same results, scenarios in the order of `NAMES`."""
    entries = results["scenarios"]
    return {**results, "scenarios": {k: entries[k] for k in sorted(entries, key=NAMES.index)}}


def write(path: Path, results: dict[str, Any]) -> None:
    """Replace a results file; values that are not finite become null."""
    text = json.dumps(_plain(results), indent=1, allow_nan=False, ensure_ascii=False)
    write_atomically(path, lambda file: file.write((text + "\n").encode()))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def _cpu_name() -> str:
    info = Path("/proc/cpuinfo")
    if sys.platform == "linux" and info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
