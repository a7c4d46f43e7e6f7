"""From phases and a transcription to a staged program, and from its unknowns back to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation._casadi import casadi
from trajopt.collocation.guess import Guess
from trajopt.collocation.interpolant import Interpolant
from trajopt.collocation.phase import Phase, evaluate
from trajopt.collocation.staged import Names, StagedNLP
from trajopt.collocation.transcriptions import Transcription
from trajopt.errors import ArgumentError

__all__ = ["Assembly", "Link", "Part"]

FloatArray = NDArray[np.float64]


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


class Assembly:
    """The staged program of phases that run side by side, each on its own time.

    Node k holds node k of every phase, so several phases have the block structure of one. A state
    at the start of a phase appears in the last node's rows only as a copy among the globals, and
    only where a boundary function depends on it and it is not fixed.

    Parameters
    ----------
    parts : sequence of Part
        Phases; all meshes have the same number of segments.
    transcription : Transcription
    links : sequence of Link
    scaled : bool
        Choose scales from bounds and guess; all are 1 otherwise.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        transcription: Transcription,
        links: Sequence[Link] = (),
        scaled: bool = False,
    ) -> None:
        self.parts, self.transcription, self.links = list(parts), transcription, list(links)
        self.segments = len(parts[0].mesh) - 1
        self._scaled = scaled
        self._columns: list[dict[tuple[str, float], slice]] = []
        width = 0
        for part in self.parts:
            columns = {}
            for c in sorted({*transcription.state_points, *transcription.control_points}):
                for kind, points, size in (
                    ("x", transcription.state_points, part.phase.nx),
                    ("u", transcription.control_points, part.phase.nu),
                ):
                    if c in points:
                        columns[kind, c] = slice(width, width + size)
                        width += size
            self._columns.append(columns)
        self._width = width
        self._collect_globals()
        self.nlp = self._build()

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

    # -- the program -----------------------------------------------------------------------------

    def _build(self) -> StagedNLP:
        n = self.segments + 1
        w, w_next = casadi.SX.sym("w", self._width), casadi.SX.sym("w_next", self._width)
        p, s = casadi.SX.sym("p", len(self._p_guess)), casadi.SX.sym("s", 2 * len(self.parts))
        cost: Any = 0.0
        entries: list[tuple[str, Any, FloatArray, FloatArray, float]] = []
        for index in range(len(self.parts)):
            part_cost, part_rows = self._stage(index, w, w_next, p, s)
            cost = cost + part_cost
            entries += part_rows
        names, rows, lower, upper, scales = zip(*entries, strict=True)
        last_cost, last, last_names, last_bounds = self._last(w, p)
        glob, glob_names, glob_lower, glob_upper = self._ends_of_time(p)
        c = casadi.vertcat(*rows)
        cost, c = casadi.cse([casadi.SX(cost), c])
        low, high = self._bounds()
        return StagedNLP(
            stage=casadi.Function("stage", [w, w_next, p, s], [cost, casadi.densify(c)]),
            last=casadi.Function("last", [w, p, s], [last_cost, casadi.densify(last)]),
            glob=casadi.Function("glob", [p], [casadi.SX(1, 1), casadi.densify(glob)]),
            n=n,
            w_lower=low,
            w_upper=high,
            w_guess=self._guess(low, high),
            p_lower=self._p_bounds[0],
            p_upper=self._p_bounds[1],
            p_guess=self._p_guess,
            s=self._data(),
            c_lower=np.array(lower, dtype=float).T,
            c_upper=np.array(upper, dtype=float).T,
            last_lower=last_bounds[0],
            last_upper=last_bounds[1],
            glob_lower=glob_lower,
            glob_upper=glob_upper,
            w_scale=self._scales(),
            p_scale=np.ones(len(self._p_guess)),
            c_scale=np.array(scales),
            names=Names(
                self._w_names(), self._p_names, tuple(names), tuple(last_names), tuple(glob_names),
                self._node_times(),
            ),
        )  # fmt: skip

    def _stage(
        self, index: int, w: Any, w_next: Any, p: Any, s: Any
    ) -> tuple[Any, list[tuple[str, Any, FloatArray, FloatArray, float]]]:
        """Return cost and rows (name, expression, bounds over the stages, scale) of one phase."""
        part, method = self.parts[index], self.transcription
        phase, where = part.phase, self._globals[index]
        x = {c: w[self._columns[index]["x", c]] for c in method.state_points}
        u = {c: w[self._columns[index]["u", c]] for c in method.control_points}
        x[1.0] = w_next[self._columns[index]["x", 0.0]]
        if method.shared_end:
            u[1.0] = w_next[self._columns[index]["u", 0.0]]
        begin, duration = s[2 * index], s[2 * index + 1]
        if {"t0", "tf"} & where.keys():
            t0, tf = self._times(index, p)
            begin, duration = t0 + begin * (tf - t0), duration * (tf - t0)
        parameters = p[where["p"]]

        def f(c: float, x: Any, u: Any) -> Any:
            return phase.f(begin + c * duration, x, u, parameters)

        def integrand(c: float, x: Any, u: Any) -> Any:
            return phase.w(begin + c * duration, x, u, parameters)

        segment = method.segment(f, integrand, duration, x, u)
        scale = self._phase_scales(index)[0]
        zero, free = np.zeros(self.segments), np.full(self.segments, np.inf)
        rows = []
        for name, expression in segment.defects:
            for i, state in enumerate(phase.x_names):
                label = f"{part.prefix}{name} of {state}"
                rows.append((label, expression[i], zero, zero, scale[i]))
        x.update(segment.states)
        for c in segment.states:
            for i in np.flatnonzero(np.isfinite(phase.x[0]) | np.isfinite(phase.x[1])).tolist():
                label = f"{part.prefix}bound of {phase.x_names[i]} at {c:.3g}"
                low, high = (np.full(self.segments, side[i]) for side in phase.x)
                rows.append((label, x[c][i], low, high, scale[i]))
        for c in method.path_points:
            values = phase.h(begin + c * duration, x[c], u[c], parameters)
            for i in self._path_rows(phase):
                label = f"{part.prefix}path[{i}]" + (f" at {c:.3g}" if c else "")
                low, high = (np.full(self.segments, side[i]) for side in phase.h_bounds)
                rows.append((label, values[i], low, high, 1.0))
        # A copy is tied to the first node; on all others the row is free.
        tie = np.where(np.arange(self.segments) == 0, 0.0, free)
        for k, i in enumerate(where["copied"]):
            label = f"{part.prefix}copy of the start of {phase.x_names[i]}"
            copy = p[where["copies"].start + k]
            rows.append((label, x[0.0][int(i)] - copy, -tie, tie, scale[i]))
        return segment.cost, rows

    @staticmethod
    def _path_rows(phase: Phase) -> list[int]:
        """Return the path constraints that are bounded at all."""
        bounded = np.isfinite(phase.h_bounds[0]) | np.isfinite(phase.h_bounds[1])
        return [int(i) for i in np.flatnonzero(bounded)]

    def _last(self, w: Any, p: Any) -> tuple[Any, Any, list[str], tuple[FloatArray, FloatArray]]:
        """Return Mayer terms and the rows at the end: path, boundary and links."""
        cost: Any = casadi.SX(1, 1)
        rows: list[Any] = []
        names: list[str] = []
        lower: list[float] = []
        upper: list[float] = []
        ends = []
        for index, part in enumerate(self.parts):
            phase, where = part.phase, self._globals[index]
            t0, tf = self._times(index, p)
            x0 = casadi.SX(casadi.DM(np.where(phase.x0[0] == phase.x0[1], phase.x0[0], 0.0)))
            for k, i in enumerate(where["copied"]):
                x0[int(i)] = p[where["copies"].start + k]
            xf, parameters = w[self._columns[index]["x", 0.0]], p[where["p"]]
            ends.append((t0, tf, x0, xf, parameters))
            cost = cost + phase.terminal(t0, tf, x0, xf, parameters)
            chosen = self._path_rows(phase)
            if self.transcription.shared_end and len(chosen):
                values = phase.h(tf, xf, w[self._columns[index]["u", 0.0]], parameters)
                rows += [values[i] for i in chosen]
                names += [f"{part.prefix}path[{i}]" for i in chosen]
                lower += list(phase.h_bounds[0][chosen])
                upper += list(phase.h_bounds[1][chosen])
            values = phase.g(t0, tf, x0, xf, parameters)
            rows += [values[i] for i in range(values.shape[0])]
            names += [f"{part.prefix}boundary[{i}]" for i in range(values.shape[0])]
            lower += list(phase.g_bounds[0])
            upper += list(phase.g_bounds[1])
        for link in self.links:
            _, tf, _, xf, parameters = ends[link.first]
            t0, _, x0, _, others = ends[link.second]
            values = link.function(tf, xf, parameters, t0, x0, others)
            rows += [values[i] for i in range(values.shape[0])]
            names += [f"{link.name}[{i}]" for i in range(values.shape[0])]
            lower += list(link.lower)
            upper += list(link.upper)
        bounds = np.array(lower, dtype=float), np.array(upper, dtype=float)
        return cost, casadi.vertcat(casadi.SX(0, 1), *rows), names, bounds

    def _ends_of_time(self, p: Any) -> tuple[Any, list[str], FloatArray, FloatArray]:
        """Return the rows tf of phases whose unknowns are start and duration."""
        rows, names, lower, upper = [], [], [], []
        for index, part in enumerate(self.parts):
            if "duration" in self._globals[index] and np.isfinite(part.phase.tf).any():
                rows.append(self._times(index, p)[1])
                names.append(f"{part.prefix}tf")
                lower.append(part.phase.tf[0])
                upper.append(part.phase.tf[1])
        bounds = np.array(lower, dtype=float), np.array(upper, dtype=float)
        return casadi.vertcat(casadi.SX(0, 1), *rows), names, *bounds

    # -- numbers ---------------------------------------------------------------------------------

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        n, method = self.segments + 1, self.transcription
        lower, upper = np.full((n, self._width), -np.inf), np.full((n, self._width), np.inf)
        for part, columns in zip(self.parts, self._columns, strict=True):
            phase = part.phase
            for (kind, c), where in columns.items():
                lower[:, where], upper[:, where] = phase.x if kind == "x" else phase.u
                if c > 0 or (kind == "u" and not method.shared_end):
                    lower[-1, where] = upper[-1, where] = 0.0  # no segment uses it
            start = columns["x", 0.0]
            lower[0, start], upper[0, start] = phase.x0
            lower[-1, start], upper[-1, start] = phase.xf
            for name, limits, node, there in (
                ("u0_bounds", phase.u0, 0, ("u", 0.0) in columns),
                ("uf_bounds", phase.uf, -1, method.shared_end),
            ):
                if there:
                    lower[node, columns["u", 0.0]], upper[node, columns["u", 0.0]] = limits
                elif not all(np.array_equal(a, b) for a, b in zip(limits, phase.u, strict=True)):
                    raise ArgumentError(
                        f"solve: {name} needs a method with a control at that end; "
                        "legendre with points='lobatto' is one"
                    )
        return lower, upper

    def _guess(self, lower: FloatArray, upper: FloatArray) -> FloatArray:
        guess = np.zeros((self.segments + 1, self._width))
        for part, columns in zip(self.parts, self._columns, strict=True):
            steps = np.append(np.diff(part.mesh), 0.0)
            for c in sorted({c for _, c in columns}):
                x, u = part.guess.sample(part.mesh + c * steps)
                for kind, values in (("x", x), ("u", u)):
                    if (kind, c) in columns:
                        guess[:, columns[kind, c]] = values
        fixed = lower == upper
        guess[fixed] = lower[fixed]
        return guess

    def _data(self) -> FloatArray:
        """Return start and duration of every segment: seconds, or shares where time is free."""
        columns = []
        for index, part in enumerate(self.parts):
            start, steps = part.mesh, np.append(np.diff(part.mesh), 0.0)
            if not {"t0", "tf"} & self._globals[index].keys():
                t0, span = part.phase.t0[0], part.phase.tf[0] - part.phase.t0[0]
                start, steps = t0 + span * start, span * steps
            columns += [start, steps]
        return np.stack(columns, axis=1)

    def _node_times(self) -> FloatArray:
        guess = self.parts[0].guess
        return np.asarray(guess.t0 + self.parts[0].mesh * (guess.tf - guess.t0), dtype=np.float64)

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

    # -- back to trajectories --------------------------------------------------------------------

    def times(self, index: int, p: FloatArray) -> FloatArray:
        """Return the times of a phase's knots [s]."""
        t0, tf = (float(value) for value in self._times(index, p))
        times = t0 + (tf - t0) * self.parts[index].mesh
        times[-1] = tf
        return np.asarray(times, dtype=np.float64)

    def parameters(self, index: int, p: FloatArray) -> FloatArray:
        """Return the parameters of a phase."""
        return np.asarray(p[self._globals[index]["p"]], dtype=np.float64)

    def states(self, index: int, w: FloatArray) -> FloatArray:
        """Return the states of a phase at its knots (n, nx)."""
        return np.array(w[:, self._columns[index]["x", 0.0]])

    def interpolant(self, index: int, w: FloatArray, p: FloatArray) -> Interpolant:
        """Return the trajectory of a phase between its knots."""
        method, columns = self.transcription, self._columns[index]
        x = {c: w[:-1, columns["x", c]] for c in method.state_points}
        u = {c: w[:-1, columns["u", c]] for c in method.control_points}
        x[1.0] = w[1:, columns["x", 0.0]]
        if method.shared_end:
            u[1.0] = w[1:, columns["u", 0.0]]
        t, parameters = self.times(index, p), self.parameters(index, p)
        h, phase = np.diff(t), self.parts[index].phase

        def f(c: float, x: FloatArray, u: FloatArray) -> FloatArray:
            return evaluate(phase.f, t[:-1] + c * h, x, u, parameters)

        pieces = method.pieces(f, h, x, u)
        ends = [t[:-1] + start * h for start, *_ in pieces]
        start, slopes, controls = (
            [piece[2] for piece in pieces],
            [np.stack(list(piece[3].values()), axis=1) for piece in pieces],
            [np.stack(list(piece[4].values()), axis=1) for piece in pieces],
        )
        return Interpolant(
            edges=np.append(_interleave(ends), t[-1]),
            start=_interleave(start),
            slope_points=np.array(list(pieces[0][3])),
            slopes=_interleave(slopes),
            control_points=np.array(list(pieces[0][4])),
            controls=_interleave(controls),
        )


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


def _interleave(parts: list[FloatArray]) -> FloatArray:
    """Return entries of the first segment's pieces, then the second's, and so on."""
    stacked = np.stack(parts, axis=1)
    return np.asarray(
        stacked.reshape(len(parts) * len(parts[0]), *stacked.shape[2:]), dtype=np.float64
    )


def _powers(bounds: tuple[FloatArray, FloatArray], values: FloatArray) -> FloatArray:
    """Return powers of two near the largest finite bound, or the largest value of the guess."""
    sizes = np.abs(np.stack(bounds))
    finite = np.where(np.isfinite(sizes), sizes, 0.0).max(axis=0, initial=0.0)
    largest = np.where(finite > 0, finite, np.abs(values).max(axis=0, initial=0.0))
    return np.asarray(np.exp2(np.round(np.log2(np.where(largest > 0, largest, 1.0)))))
