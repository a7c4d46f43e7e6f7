"""Files of collocation solutions: NumPy ``.npz`` archives without pickled objects."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.collocation.diagnosis import Violation
from trajopt.collocation.interpolant import Interpolant
from trajopt.collocation.solution import Pass, Solution
from trajopt.status import Status
from trajopt.storage import FileFormatError, read_archive, write_atomically

__all__ = ["load_solution", "save_solution"]

FORMAT = "trajopt-collocation"
VERSION = 1
ARRAYS = ("t", "x", "u", "error", "parameters", "mesh")
SCALARS = ("message", "objective", "iterations", "method", "solver", "seconds")
PIECES = "interpolant."


def save_solution(solution: Solution, path: str | os.PathLike[str]) -> None:
    """Write `solution` to `path`, atomically."""
    info: dict[str, Any] = {name: getattr(solution, name) for name in SCALARS}
    info |= {
        "history": solution.history,
        "passes": [dataclasses.asdict(entry) for entry in solution.passes],
        "violations": [dataclasses.asdict(entry) for entry in solution.violations],
        "x_names": solution.x_names,
        "u_names": solution.u_names,
        "degrees": solution.degrees,
    }
    entries: dict[str, Any] = {name: getattr(solution, name) for name in ARRAYS}
    entries |= {
        PIECES + part.name: getattr(solution.interpolant, part.name)
        for part in dataclasses.fields(Interpolant)
    }
    entries |= {
        "format": np.str_(FORMAT),
        "version": np.int64(VERSION),
        "status": np.str_(solution.status),
        "info": np.str_(json.dumps(info)),
    }
    write_atomically(path, lambda file: np.savez_compressed(file, **entries))


def load_solution(path: str | os.PathLike[str]) -> Solution:
    """Read what `save_solution` wrote; raise `FileFormatError` where that is not possible."""
    entries = read_archive(Path(path), FORMAT, VERSION, "collocation solution")
    try:
        info = json.loads(str(entries["info"]))
        pieces = {
            part.name: entries[PIECES + part.name] for part in dataclasses.fields(Interpolant)
        }
        return Solution(
            status=Status(str(entries["status"])),
            interpolant=Interpolant(**pieces),
            history=info["history"],
            passes=[
                Pass(
                    **{
                        **entry,
                        "status": Status(entry["status"]),
                        "degrees": tuple(entry.get("degrees", ())),
                    }
                )
                for entry in info["passes"]
            ],
            violations=[Violation(**entry) for entry in info["violations"]],
            x_names=tuple(info["x_names"]),
            u_names=tuple(info["u_names"]),
            degrees=tuple(info.get("degrees", ())),
            **{name: entries[name] for name in ARRAYS},
            **{name: info[name] for name in SCALARS},
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path}: damaged solution file ({error})") from error
