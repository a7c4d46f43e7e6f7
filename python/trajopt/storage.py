"""Trajectory files: NumPy ``.npz`` archives without pickled objects.

Arrays are stored as arrays, everything else as JSON text, the model as its XML text. See
``docs/file_format.md`` for the entries. Reading a file never executes anything in it.
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import TrajoptError
from trajopt.records import IterationRecord
from trajopt.status import Status

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from trajopt.solution import Solution

__all__ = ["FileFormatError", "load_solution", "save_solution", "write_atomically"]

FORMAT = "trajopt-trajectory"
VERSION = 1

ARRAYS = (
    "x",
    "u",
    "times",
    "control_points",
    "contact_forces",
    "contact_points",
    "center_of_mass",
    "frame_violation",
    "fine_violation",
)
SCALARS = (
    "message",
    "iterations",
    "objective",
    "objective_terms",
    "constraint_violation",
    "body_weight",
    "seconds",
    "device",
    "ordering",
    "seed",
    "settings",
)
REQUIRED = ("x", "u", "times", "control_points", "dt", "model", "model_data", "status", "info")


class FileFormatError(TrajoptError, ValueError):
    """A file is missing, damaged or not of the expected kind."""


def save_solution(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write `solution` to `path`, atomically."""
    info = {name: getattr(solution, name) for name in SCALARS}
    info["history"] = [record.to_dict() for record in solution.history]
    entries: dict[str, Any] = {name: getattr(solution, name) for name in ARRAYS}
    entries |= {
        "format": np.str_(FORMAT),
        "version": np.int64(VERSION),
        "dt": np.float64(solution.dt),
        "status": np.str_(solution.status),
        "model": np.str_(solution.model.xml),
        "model_data": np.str_(_dump(solution.model.to_dict())),
        "info": np.str_(_dump(info)),
    }
    write_atomically(path, lambda file: np.savez_compressed(file, **entries))


def load_solution(path: str | os.PathLike[str]) -> Solution:
    """Read what `save_solution` wrote; raise `FileFormatError` where that is not possible."""
    from trajopt.model import Model
    from trajopt.solution import Solution

    entries = _read(Path(path))
    try:
        info = json.loads(str(entries["info"]))
        return Solution(
            model=Model.from_dict(json.loads(str(entries["model_data"]))),
            status=Status(str(entries["status"])),
            dt=float(entries["dt"]),
            history=[IterationRecord.from_dict(values) for values in info["history"]],
            **{name: entries[name] for name in ARRAYS if name in entries},
            **{name: info[name] for name in SCALARS if name in info},
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: damaged trajectory file ({error})") from error


def write_atomically(
    path: str | os.PathLike[str], write: Callable[[IO[bytes]], object]
) -> None:
    """Replace the file at `path` by what `write` puts into a binary stream.

    Readers see the old file or the new one, never a part; if `write` fails the old one stays.

    Parameters
    ----------
    path : path-like
        File to replace. Missing folders are made.
    write : callable
        Called with the stream to write to.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _read(path: Path) -> dict[str, NDArray[Any]]:
    """Return all entries of the archive at `path` after checking that it is ours."""
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file")
    try:
        with np.load(path, allow_pickle=False) as archive:
            entries = {name: archive[name] for name in archive.files}
    except (AttributeError, EOFError, OSError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(f"{path}: not a readable .npz file ({error})") from error
    if str(entries.get("format")) != FORMAT:
        raise FileFormatError(f"{path}: an .npz file, but not a trajectory of trajopt")
    if int(entries.get("version", 0)) > VERSION:
        raise FileFormatError(
            f"{path}: format version {int(entries['version'])}, this trajopt reads up to {VERSION}"
        )
    missing = [name for name in REQUIRED if name not in entries]
    if missing:
        raise FileFormatError(f"{path}: damaged trajectory file (no {', '.join(missing)})")
    return entries


def _dump(value: Any) -> str:
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    """Turn NumPy values into what JSON can hold."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory file")
