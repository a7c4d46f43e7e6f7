"""Trajectory files: NumPy ``.npz`` archives without pickled objects.

Arrays are stored as arrays, everything else as JSON text, the model as its XML text and, under
names that begin with ``model.``, what was made of it. See
``docs/file_format.md`` for the entries. Reading a file never executes anything in it.
"""

from __future__ import annotations

import dataclasses
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
    from collections.abc import Callable, Sequence

    from trajopt.solution import Solution

__all__ = [
    "FileFormatError",
    "load_solution",
    "read_archive",
    "save_solution",
    "write_atomically",
]

FORMAT = "trajopt-trajectory"
VERSION = 1

ARRAYS = (
    "dt",
    "initial",
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
    "integrator",
    "ordering",
    "seed",
    "settings",
)
MODEL = "model."
REQUIRED = ("x", "u", "times", "control_points", "dt", "model", "status", "info")


class FileFormatError(TrajoptError, ValueError):
    """A file is missing, damaged or not of the expected kind."""


def save_solution(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write `solution` to `path`, atomically."""
    info = {name: getattr(solution, name) for name in SCALARS}
    info["history"] = [record.to_dict() for record in solution.history]
    info["world"] = describe(solution.world)
    info["contact"] = describe(solution.contact)
    model = solution.model.to_dict()
    entries: dict[str, Any] = {name: getattr(solution, name) for name in ARRAYS}
    entries |= {
        "format": np.str_(FORMAT),
        "version": np.int64(VERSION),
        "status": np.str_(solution.status),
        "model": model.pop("xml"),
        "info": np.str_(json.dumps(info, default=_plain)),
    }
    entries |= {MODEL + name: value for name, value in model.items()}
    write_atomically(path, lambda file: np.savez_compressed(file, **entries))


def load_solution(path: str | os.PathLike[str]) -> Solution:
    """Read what `save_solution` wrote; raise `FileFormatError` where that is not possible."""
    from trajopt.model import Model
    from trajopt.solution import Solution

    entries = read_archive(Path(path), FORMAT, VERSION, "trajectory", REQUIRED)
    try:
        info = json.loads(str(entries["info"]))
        model = {name[len(MODEL) :]: entries[name] for name in entries if name.startswith(MODEL)}
        dt = entries.pop("dt")
        fields: dict[str, Any] = {name: entries[name] for name in ARRAYS if name in entries}
        fields |= {name: info[name] for name in SCALARS if name in info}
        return Solution(
            model=Model.from_dict({**model, "xml": entries["model"]}),
            status=Status(str(entries["status"])),
            dt=dt if dt.ndim else float(dt),
            world=restore(info["world"]),
            contact=restore(info["contact"]),
            history=[IterationRecord.from_dict(values) for values in info["history"]],
            **fields,
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: damaged trajectory file ({error})") from error


def write_atomically(path: str | os.PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
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


def read_archive(
    path: Path, kind: str, version: int, what: str, required: Sequence[str] = ()
) -> dict[str, Any]:
    """Return all entries of the archive at `path` after checking that it is ours.

    Parameters
    ----------
    path : Path
    kind : str
        What its entry ``format`` must say.
    version : int
        Newest version that is understood.
    what : str
        The same for messages: "trajectory".
    required : sequence of str
        Entries that must be there.

    Raises
    ------
    FileFormatError
    """
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file")
    if not zipfile.is_zipfile(path):
        raise FileFormatError(f"{path}: not a trajopt result (.npz)")
    try:
        with np.load(path, allow_pickle=False) as archive:
            entries = {name: archive[name] for name in archive.files}
    except (AttributeError, EOFError, OSError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise FileFormatError(f"{path}: not a readable .npz file ({error})") from error
    if str(entries.get("format")) != kind:
        raise FileFormatError(f"{path}: an .npz file, but not a {what} of trajopt")
    if int(entries.get("version", 0)) > version:
        raise FileFormatError(
            f"{path}: format version {int(entries['version'])}, this trajopt reads up to {version}"
        )
    missing = [name for name in required if name not in entries]
    if missing:
        raise FileFormatError(f"{path}: damaged {what} file (no {', '.join(missing)})")
    return entries


def describe(thing: Any) -> Any:
    """Return a World, Contact or obstacle as JSON values that `restore` understands."""
    if isinstance(thing, (list, tuple)):
        return [describe(part) for part in thing]
    if not dataclasses.is_dataclass(thing):
        return thing
    parts = {f.name: describe(getattr(thing, f.name)) for f in dataclasses.fields(thing)}
    return {"type": type(thing).__name__, **parts}


def restore(values: Any) -> Any:
    """Return what `describe` described; only classes of `trajopt.world` are ever made."""
    from trajopt import world

    if isinstance(values, list):
        return [restore(part) for part in values]
    if not isinstance(values, dict):
        return values
    parts = {name: restore(part) for name, part in values.items() if name != "type"}
    if values.get("type") not in world.__all__:
        raise ValueError(f"unknown part of a world: {values.get('type')!r}")
    return getattr(world, values["type"])(**parts)


def _plain(value: Any) -> Any:
    """Turn NumPy values into what JSON can hold."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be stored in a trajectory file")
