"""Where the unknowns of phases stand in a staged program, with their bounds, guesses and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.guess import Guess
from trajopt.collocation.phase import Phase
from trajopt.collocation.transcriptions import Transcription
from trajopt.errors import ArgumentError
from trajopt.tracing import casadi

__all__ = ["Layout", "Link", "Part"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Part:
    """A phase with its mesh, its start, and a prefix for names in messages."""

    phase: Phase
    mesh: FloatArray
    guess: Guess
    prefix: str = ""


@dataclass(frozen=True)
class Link:
    """Rows that couple the end of phase `first` with the start of phase `second`.

    `function` takes (tf, xf, p) of the first and (t0, x0, p) of the second phase.
    """

    first: int
    second: int
    function: Any
    lower: FloatArray
    upper: FloatArray
    name: str


class Layout:
    """Columns of the nodes and entries of the globals.

    Node k holds one node of every phase, so several phases have the block structure of one. They
    all end at the last node; a phase with fewer segments than another begins at a later one, and
    what its columns hold before is fixed and its rows there are free. A state at the start of a
    phase appears in the last node's rows only as a copy among the globals, and only where a
    boundary function depends on it and it is not fixed.

    Parameters
    ----------
    parts : sequence of Part
        Phases with their meshes.
    transcription : Transcription or sequence of Transcription
        One for all phases, or one for each.
    links : sequence of Link
    scaled : bool
        Choose scales from bounds and guess; all are 1 otherwise.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        transcription: Transcription | Sequence[Transcription],
        links: Sequence[Link] = (),
        scaled: bool = False,
    ) -> None:
        self.parts, self.links, self._scaled = list(parts), list(links), scaled
        if isinstance(transcription, Transcription):
            transcription = [transcription] * len(parts)
        self.methods = list(transcription)
        counts = [len(part.mesh) - 1 for part in self.parts]
        self.segments = max(counts)
        # The node at which a phase begins.
        self.first = [self.segments - count for count in counts]
        self._columns: list[dict[tuple[str, float], slice]] = []
        width = 0
        for part, method in zip(self.parts, self.methods, strict=True):
            columns = {}
            for c in sorted({*method.state_points, *method.control_points}):
                for kind, points, size in (
                    ("x", method.state_points, part.phase.nx),
                    ("u", method.control_points, part.phase.nu),
                ):
                    if c in points:
                        columns[kind, c] = slice(width, width + size)
                        width += size
            self._columns.append(columns)
            if part.phase.at_start.numel_out(0) and ("u", 0.0) not in columns:
                raise _no_control("at_start")
            if part.phase.at_end.numel_out(0) and not method.shared_end:
                raise _no_control("at_end")
        self._width = width
        self._collect_globals()

    # -- globals ---------------------------------------------------------------------------------

    def _collect_globals(self) -> None:
        """Lay out p: free times, parameters, and copies of initial states."""
        self._globals: list[dict[str, Any]] = []
        lower: list[float] = []
        upper: list[float] = []
        guess: list[float] = []
        names: list[str] = []
        for index, part in enumerate(self.parts):
            phase = part.phase
            where: dict[str, Any] = {}
            for name, (low, high), value in _free_times(part):
                where[name] = len(names)
                lower.append(low)
                upper.append(high)
                guess.append(value)
                names.append(part.prefix + name)
            where["p"] = slice(len(names), len(names) + phase.np)
            lower.extend(phase.p[0])
            upper.extend(phase.p[1])
            guess.extend(part.guess.parameters)
            names.extend(part.prefix + name for name in phase.p_names)
            free = phase.x0[0] < phase.x0[1]
            copied = np.flatnonzero(self._reads_start(index) & free)
            where["copied"] = copied
            where["copies"] = slice(len(names), len(names) + len(copied))
            first = part.guess.sample(np.zeros(1))[0][0]
            lower.extend(phase.x0[0][copied])
            upper.extend(phase.x0[1][copied])
            guess.extend(first[copied])
            names.extend(f"{part.prefix}start of {phase.x_names[i]}" for i in copied)
            self._globals.append(where)
        self._p_bounds = np.array(lower, dtype=float), np.array(upper, dtype=float)
        self._p_guess, self._p_names = np.array(guess, dtype=float), tuple(names)

    def _reads_start(self, index: int) -> NDArray[np.bool_]:
        """Return which initial states of a phase its boundary functions and links depend on."""
        phase = self.parts[index].phase
        x0, p = casadi.SX.sym("x0", phase.nx), casadi.SX.sym("p", phase.np)
        times = casadi.SX.sym("t", 2)
        xf = casadi.SX.sym("xf", phase.nx)
        ends = (times[0], times[1], x0, xf, p)
        rows = [phase.g(*ends), phase.terminal(*ends)]
        for link in self.links:
            if link.second == index:
                other = self.parts[link.first].phase
                free = [casadi.SX.sym("other", n) for n in (1, other.nx, other.np)]
                rows.append(link.function(*free, times[0], x0, p))
        reads = casadi.which_depends(casadi.vertcat(*rows), x0, 1, False)
        return np.array(reads, dtype=bool)

    def _times(self, index: int, p: Any) -> tuple[Any, Any]:
        """Return start and end of a phase; `p` holds symbols or numbers."""
        where, phase = self._globals[index], self.parts[index].phase
        t0 = p[where["t0"]] if "t0" in where else phase.t0[0]
        if "duration" in where:
            return t0, t0 + p[where["duration"]]
        return t0, p[where["tf"]] if "tf" in where else phase.tf[0]

    # -- numbers ---------------------------------------------------------------------------------

    def _used(self, index: int, c: float) -> BoolArray:
        """Return in which segments of the chain a phase has unknowns at the point named c."""
        first, method = self.first[index], self.methods[index]
        return np.append(np.zeros(first, bool), method.uses(c, self.segments - first))

    def _bounds(self, guess: FloatArray) -> tuple[FloatArray, FloatArray]:
        n = self.segments + 1
        lower, upper = np.full((n, self._width), -np.inf), np.full((n, self._width), np.inf)
        for index, (part, columns) in enumerate(zip(self.parts, self._columns, strict=True)):
            phase, method, first = part.phase, self.methods[index], self.first[index]
            for (kind, c), where in columns.items():
                lower[:, where], upper[:, where] = phase.x if kind == "x" else phase.u
                last = c == 0 and (kind == "x" or method.shared_end)
                idle = ~np.append(self._used(index, c), last)
                lower[idle, where] = upper[idle, where] = guess[idle, where]
            start = columns["x", 0.0]
            lower[first, start], upper[first, start] = phase.x0
            lower[-1, start], upper[-1, start] = phase.xf
            for name, limits, node, there in (
                ("u0_bounds", phase.u0, first, ("u", 0.0) in columns),
                ("uf_bounds", phase.uf, -1, method.shared_end),
            ):
                if there:
                    lower[node, columns["u", 0.0]], upper[node, columns["u", 0.0]] = limits
                elif not all(np.array_equal(a, b) for a, b in zip(limits, phase.u, strict=True)):
                    raise _no_control(name)
        return lower, upper

    def _guess(self) -> FloatArray:
        guess = np.zeros((self.segments + 1, self._width))
        for index, (part, columns) in enumerate(zip(self.parts, self._columns, strict=True)):
            first, begin, steps = self.first[index], part.mesh[:-1], np.diff(part.mesh)
            for c in sorted({c for _, c in columns}):
                places = begin + self.methods[index].place(c) * steps
                x, u = part.guess.sample(np.concatenate([np.zeros(first), places, [1.0]]))
                for kind, values in (("x", x), ("u", u)):
                    if (kind, c) in columns:
                        guess[:, columns[kind, c]] = values
        return guess

    def _data(self) -> FloatArray:
        """Return what the stages read of every segment, phase by phase.

        Start and duration, in seconds or as shares where time is free, then the method's data.
        Segments before a phase begins have no duration.
        """
        columns: list[FloatArray] = []
        for index, part in enumerate(self.parts):
            begin, steps = part.mesh, np.append(np.diff(part.mesh), 0.0)
            if not {"t0", "tf"} & self._globals[index].keys():
                t0, span = part.phase.t0[0], part.phase.tf[0] - part.phase.t0[0]
                begin, steps = t0 + span * begin, span * steps
            first = self.first[index]
            data = self.methods[index].data(self.segments - first)
            columns += [
                np.append(np.full(first, begin[0]), begin)[:, None],
                np.append(np.zeros(first), steps)[:, None],
                np.pad(data, ((first, 1), (0, 0))),
            ]
        return np.hstack(columns)

    def _data_slices(self) -> list[slice]:
        """Return where the data of every phase stand in those of a stage."""
        sizes = [2 + method.data(len(part.mesh) - 1).shape[1] for part, method in
                 zip(self.parts, self.methods, strict=True)]  # fmt: skip
        ends = np.cumsum(sizes)
        return [slice(int(end) - size, int(end)) for end, size in zip(ends, sizes, strict=True)]

    def _node_times(self) -> FloatArray:
        index = int(np.argmin(self.first))
        guess, mesh = self.parts[index].guess, self.parts[index].mesh
        return np.asarray(guess.t0 + mesh * (guess.tf - guess.t0), dtype=np.float64)

    def _phase_scales(self, index: int) -> tuple[FloatArray, FloatArray]:
        """Return powers of two of the size of states and controls."""
        part = self.parts[index]
        x, u = part.guess.sample(np.linspace(0.0, 1.0, 9))
        if not self._scaled:
            return np.ones(part.phase.nx), np.ones(part.phase.nu)
        return _powers(part.phase.x, x), _powers(part.phase.u, u)

    def _scales(self) -> FloatArray:
        scales = np.ones(self._width)
        for index, columns in enumerate(self._columns):
            x, u = self._phase_scales(index)
            for (kind, _), where in columns.items():
                scales[where] = x if kind == "x" else u
        return scales

    def _w_names(self) -> tuple[str, ...]:
        names = [""] * self._width
        for part, columns in zip(self.parts, self._columns, strict=True):
            for (kind, c), where in columns.items():
                known = part.phase.x_names if kind == "x" else part.phase.u_names
                names[where] = [f"{part.prefix}{n}" + (f" at {c:.3g}" if c else "") for n in known]
        return tuple(names)


def _free_times(part: Part) -> list[tuple[str, tuple[float, float], float]]:
    """Return name, bounds and guess of the unknown times of a phase.

    With both ends free the unknowns are start and duration: a bound of an unknown is never left,
    so time cannot run backward on the way, as it could with a constraint tf >= t0.
    """
    (low, high), (first, last), guess = part.phase.t0, part.phase.tf, part.guess
    if low < high and first < last:
        duration = max(first - high, 0.0), last - low
        return [("t0", (low, high), guess.t0), ("duration", duration, guess.tf - guess.t0)]
    if low < high:
        return [("t0", (low, min(high, first)), guess.t0)]
    if first < last:
        return [("tf", (max(first, low), last), guess.tf)]
    return []


def _no_control(name: str) -> ArgumentError:
    return ArgumentError(
        f"solve: {name} needs a method with a control at that end; "
        "legendre with points='lobatto' is one"
    )


def _powers(bounds: tuple[FloatArray, FloatArray], values: FloatArray) -> FloatArray:
    """Return powers of two near the largest finite bound, or the largest value of the guess."""
    sizes = np.abs(np.stack(bounds))
    finite = np.where(np.isfinite(sizes), sizes, 0.0).max(axis=0, initial=0.0)
    largest = np.where(finite > 0, finite, np.abs(values).max(axis=0, initial=0.0))
    return np.asarray(np.exp2(np.round(np.log2(np.where(largest > 0, largest, 1.0)))))
