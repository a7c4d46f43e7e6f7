"""From phases and a transcription to a staged program, and from its unknowns back to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.interpolant import Interpolant
from trajopt.collocation.layout import Layout, Link, Part
from trajopt.collocation.phase import Phase, evaluate
from trajopt.collocation.staged import Names, StagedNLP
from trajopt.collocation.transcriptions import Transcription
from trajopt.tracing import casadi

__all__ = ["Assembly", "Link", "Part"]

FloatArray = NDArray[np.float64]


class Assembly(Layout):
    """The staged program of phases that run side by side, each on its own time; see `Layout`."""

    def __init__(
        self,
        parts: Sequence[Part],
        transcription: Transcription | Sequence[Transcription],
        links: Sequence[Link] = (),
        scaled: bool = False,
    ) -> None:
        super().__init__(parts, transcription, links, scaled)
        self.nlp = self._build()

    # -- the program -----------------------------------------------------------------------------

    def _build(self) -> StagedNLP:
        n = self.segments + 1
        data = self._data()
        w, w_next = casadi.SX.sym("w", self._width), casadi.SX.sym("w_next", self._width)
        p, s = casadi.SX.sym("p", len(self._p_guess)), casadi.SX.sym("s", data.shape[1])
        cost: Any = 0.0
        self._costs: list[Any] = []
        entries: list[tuple[str, Any, FloatArray, FloatArray, float]] = []
        for index, where in enumerate(self._data_slices()):
            part_cost, part_rows = self._stage(index, w, w_next, p, s[where])
            cost = cost + part_cost
            self._costs.append(casadi.Function("cost", [w, w_next, p, s], [part_cost]))
            entries += part_rows
        names, rows, lower, upper, scales = zip(*entries, strict=True)
        last_cost, last, last_names, last_bounds = self._last(w, p)
        glob, glob_names, glob_lower, glob_upper = self._ends_of_time(p)
        c = casadi.vertcat(*rows)
        cost, c = casadi.cse([casadi.SX(cost), c])
        guess = self._guess()
        low, high = self._bounds(guess)
        guess = np.where(low == high, low, guess)
        return StagedNLP(
            stage=casadi.Function("stage", [w, w_next, p, s], [cost, casadi.densify(c)]),
            last=casadi.Function("last", [w, p, s], [last_cost, casadi.densify(last)]),
            glob=casadi.Function("glob", [p], [casadi.SX(1, 1), casadi.densify(glob)]),
            n=n,
            w_lower=low,
            w_upper=high,
            w_guess=guess,
            p_lower=self._p_bounds[0],
            p_upper=self._p_bounds[1],
            p_guess=self._p_guess,
            s=data,
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
        part, whole = self.parts[index], self.methods[index]
        phase, where, first = part.phase, self._globals[index], self.first[index]
        begin, duration, method = s[0], s[1], whole.given(s[2:])
        x = {c: w[self._columns[index]["x", c]] for c in method.state_points}
        u = {c: w[self._columns[index]["u", c]] for c in method.control_points}
        x[1.0] = w_next[self._columns[index]["x", 0.0]]
        if method.shared_end:
            u[1.0] = w_next[self._columns[index]["u", 0.0]]
        if {"t0", "tf"} & where.keys():
            t0, tf = self._times(index, p)
            begin, duration = t0 + begin * (tf - t0), duration * (tf - t0)
        parameters = p[where["p"]]

        def f(c: float, x: Any, u: Any) -> Any:
            return phase.f(begin + method.place(c) * duration, x, u, parameters)

        def integrand(c: float, x: Any, u: Any) -> Any:
            return phase.w(begin + method.place(c) * duration, x, u, parameters)

        segment = method.segment(f, integrand, duration, x, u)
        scale = self._phase_scales(index)[0]
        rows = []
        holds = whole.holds(len(segment.defects), self.segments - first)
        for (name, expression), there in zip(segment.defects, holds, strict=True):
            zero = np.where(np.append(np.zeros(first, bool), there), 0.0, np.inf)
            for i, state in enumerate(phase.x_names):
                label = f"{part.prefix}{name} of {state}"
                rows.append((label, expression[i], -zero, zero, scale[i]))
        x.update(segment.states)
        for c in segment.states:
            used = self._used(index, c)
            for i in np.flatnonzero(np.isfinite(phase.x[0]) | np.isfinite(phase.x[1])).tolist():
                label = f"{part.prefix}bound of {phase.x_names[i]} at {c:.3g}"
                low, high = (
                    np.where(used, phase.x[0][i], -np.inf),
                    np.where(used, phase.x[1][i], np.inf),
                )
                rows.append((label, x[c][i], low, high, scale[i]))
        for c in method.path_points:
            used = self._used(index, c)
            values = phase.h(begin + method.place(c) * duration, x[c], u[c], parameters)
            for i in self._path_rows(phase):
                label = f"{part.prefix}path[{i}]" + (f" at {c:.3g}" if c else "")
                low = np.where(used, phase.h_bounds[0][i], -np.inf)
                high = np.where(used, phase.h_bounds[1][i], np.inf)
                rows.append((label, values[i], low, high, 1.0))
        values = phase.at_start(begin, x[0.0], u.get(0.0, 0.0), parameters)
        there = np.arange(self.segments) == first
        for i in range(values.shape[0]):
            low = np.where(there, phase.start_bounds[0][i], -np.inf)
            high = np.where(there, phase.start_bounds[1][i], np.inf)
            rows.append((f"{part.prefix}at_start[{i}]", values[i], low, high, 1.0))
        # A copy is tied to the node where the phase begins; on all others the row is free.
        tie = np.where(np.arange(self.segments) == first, 0.0, np.inf)
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
            if self.methods[index].shared_end and len(chosen):
                values = phase.h(tf, xf, w[self._columns[index]["u", 0.0]], parameters)
                rows += [values[i] for i in chosen]
                names += [f"{part.prefix}path[{i}]" for i in chosen]
                lower += list(phase.h_bounds[0][chosen])
                upper += list(phase.h_bounds[1][chosen])
            if phase.at_end.numel_out(0):
                u = w[self._columns[index]["u", 0.0]]
                values = phase.at_end(tf, xf, u, parameters)
                rows += [values[i] for i in range(values.shape[0])]
                names += [f"{part.prefix}at_end[{i}]" for i in range(values.shape[0])]
                lower += list(phase.end_bounds[0])
                upper += list(phase.end_bounds[1])
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
        return np.array(w[self.first[index] :, self._columns[index]["x", 0.0]])

    def objective(self, index: int, w: FloatArray, p: FloatArray) -> float:
        """Return what a phase contributes to the objective."""
        stages = self.segments
        columns = np.tile(p[:, None], (1, stages)), self.nlp.s[:-1].T
        integral = self._costs[index].map(stages)(w[:-1].T, w[1:].T, *columns)
        t0, tf = self._times(index, p)
        x = self.states(index, w)
        mayer = self.parts[index].phase.terminal(t0, tf, x[0], x[-1], self.parameters(index, p))
        return float(casadi.sum2(integral)) + float(mayer)

    def costates(
        self, index: int, w: FloatArray, p: FloatArray, multipliers: FloatArray
    ) -> FloatArray:
        """Return ∂(cost to go)/∂x at the knots of a phase (n, nx), from the multipliers.

        The Lagrangian of the segment before a knot falls with the state there as fast as that of
        the rest grows. At the start only the rest is there.
        """
        v, v_next = casadi.SX.sym("w", self._width), casadi.SX.sym("w_next", self._width)
        q, s = casadi.SX.sym("p", len(p)), casadi.SX.sym("s", self.nlp.s.shape[1])
        y = casadi.SX.sym("y", multipliers.shape[1])
        cost, c = self.nlp.stage(v, v_next, q, s)
        total = cost + casadi.dot(y, c)
        where = self._columns[index]["x", 0.0]
        ends = [casadi.gradient(total, each)[where] for each in (v, v_next)]
        slopes = casadi.Function("slopes", [v, v_next, q, s, y], ends)
        copies = [f"{self.parts[index].prefix}copy of" in name for name in self.nlp.names.stage]
        known = np.where(copies, 0.0, multipliers)
        stages = self.segments
        begin, end = slopes.map(stages)(
            w[:-1].T, w[1:].T, np.tile(p[:, None], (1, stages)), self.nlp.s[:-1].T, known.T
        )
        first = self.first[index]
        return np.vstack([begin.full().T[first : first + 1], -end.full().T[first:]])

    def interpolant(self, index: int, w: FloatArray, p: FloatArray) -> Interpolant:
        """Return the trajectory of a phase between its knots."""
        method, columns = self.methods[index], self._columns[index]
        w = w[self.first[index] :]
        x = {c: w[:-1, columns["x", c]] for c in method.state_points}
        u = {c: w[:-1, columns["u", c]] for c in method.control_points}
        x[1.0] = w[1:, columns["x", 0.0]]
        if method.shared_end:
            u[1.0] = w[1:, columns["u", 0.0]]
        t, parameters = self.times(index, p), self.parameters(index, p)
        h, phase = np.diff(t), self.parts[index].phase

        def f(c: float, x: FloatArray, u: FloatArray) -> FloatArray:
            return evaluate(phase.f, t[:-1] + method.place(c) * h, x, u, parameters)

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


def _interleave(parts: list[FloatArray]) -> FloatArray:
    """Return entries of the first segment's pieces, then the second's, and so on."""
    stacked = np.stack(parts, axis=1)
    return np.asarray(
        stacked.reshape(len(parts) * len(parts[0]), *stacked.shape[2:]), dtype=np.float64
    )
