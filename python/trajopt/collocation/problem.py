"""Optimal control problems: what the user states, checked and traced once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from trajopt.checks import number, whole
from trajopt.collocation.bounds import Pair, both, pair
from trajopt.collocation.guess import Guess, make_guess
from trajopt.collocation.phase import Phase
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.tracing import trace

__all__ = ["Problem"]

Bounds = tuple[Any, Any]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Problem:
    """Minimize J(t0, tf, x0, xf) + ∫ w(t, x, u) dt subject to ẋ = f(t, x, u) and constraints.

    All functions are plain Python with NumPy functions on components, such as ``np.sin(x[1])``.
    With `parameters` they take the parameters as one more argument, the last.

    Parameters
    ----------
    dynamics : callable
        ``f(t, x, u)`` -> nx values.
    nx, nu : int
        Numbers of states and controls.
    t0, tf : float, optional
        Fixed start and end of time [s]; t0 is 0 unless given.
    t0_bounds, tf_bounds : (float, float), optional
        In place of them: bounds of a free start or end [s].
    objective : callable, optional
        Integrand ``w(t, x, u)``, the Lagrange term.
    terminal : callable, optional
        Mayer term ``J(t0, tf, x0, xf)``.
    path : (callable, lower, upper), optional
        ``lower <= h(t, x, u) <= upper`` along the whole path.
    boundary : (callable, lower, upper), optional
        ``lower <= g(t0, tf, x0, xf) <= upper``.
    at_start, at_end : (callable, lower, upper), optional
        ``lower <= h(t, x, u) <= upper`` at one end only, for conditions on the control there; the
        method must have a collocation point at that end.
    x_bounds, u_bounds : (lower, upper), optional
        Bounds along the path: a number for all components, or one a component, None for none.
    x0_bounds, xf_bounds, u0_bounds, uf_bounds : (lower, upper), optional
        Bounds at the start and at the end.
    periodic : bool or sequence of int
        States that end where they began; True means all. Other maps are boundary constraints.
    parameters : int
        Number of constant unknowns.
    parameter_bounds : (lower, upper), optional
    guess : dict, callable, Solution, optional
        ``{"t": (m,), "x": (m, nx), "u": (m, nu), "p": (parameters,)}`` (each may be left out), a
        function of t that returns x and u, or an earlier solution. Default: a straight line
        between the middles of the bounds at the ends, with no control.
    x_names, u_names, parameter_names : sequence of str, optional
        For messages and pictures.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Naming what cannot be used, and why; a function that cannot be traced is shown with the
        line and with what to write instead.

    Examples
    --------
    The block of Kelly, section 2: one unit of distance in one unit of time.

    >>> from trajopt import collocation as col
    >>> block = col.Problem(
    ...     dynamics=lambda t, x, u: [x[1], u[0]],
    ...     nx=2,
    ...     nu=1,
    ...     tf=1.0,
    ...     objective=lambda t, x, u: u[0] ** 2,
    ...     x0_bounds=([0, 0], [0, 0]),
    ...     xf_bounds=([1, 0], [1, 0]),
    ... )
    >>> round(col.solve(block, segments=4).objective, 6)
    12.0
    """

    dynamics: Callable[..., Any]
    nx: int
    nu: int
    t0: float | None = None
    tf: float | None = None
    t0_bounds: tuple[float | None, float | None] | None = None
    tf_bounds: tuple[float | None, float | None] | None = None
    objective: Callable[..., Any] | None = None
    terminal: Callable[..., Any] | None = None
    path: tuple[Callable[..., Any], Any, Any] | None = None
    boundary: tuple[Callable[..., Any], Any, Any] | None = None
    at_start: tuple[Callable[..., Any], Any, Any] | None = None
    at_end: tuple[Callable[..., Any], Any, Any] | None = None
    x_bounds: Bounds | None = None
    u_bounds: Bounds | None = None
    x0_bounds: Bounds | None = None
    xf_bounds: Bounds | None = None
    u0_bounds: Bounds | None = None
    uf_bounds: Bounds | None = None
    periodic: bool | Sequence[int] = False
    parameters: int = 0
    parameter_bounds: Bounds | None = None
    guess: Any = None
    x_names: Sequence[str] | None = None
    u_names: Sequence[str] | None = None
    parameter_names: Sequence[str] | None = None
    phase: Phase = field(init=False)
    start: Guess = field(init=False)

    def __post_init__(self) -> None:
        nx, nu = whole("Problem", "nx", self.nx, 1), whole("Problem", "nu", self.nu, 0)
        count = whole("Problem", "parameters", self.parameters, 0)
        names = (
            _names("x_names", "x", self.x_names, nx),
            _names("u_names", "u", self.u_names, nu),
            _names("parameter_names", "p", self.parameter_names, count),
        )
        t0, tf = self._times()
        x, u = self._pair("x_bounds", names[0]), self._pair("u_bounds", names[1])
        running = (("t", -1), ("x", nx), ("u", nu), ("p", count))
        ends = (("t0", -1), ("tf", -1), ("x0", nx), ("xf", nx), ("p", count))
        g, g_bounds = self._constraint("boundary", ends, self._periods(names[0]))
        h, h_bounds = self._constraint("path", running, [])
        at_start, start_bounds = self._constraint("at_start", running, [])
        at_end, end_bounds = self._constraint("at_end", running, [])
        phase = Phase(
            nx=nx,
            nu=nu,
            np=count,
            f=trace("Problem", "dynamics", self.dynamics, running, nx),
            w=self._integrand("objective", running),
            h=h,
            g=g,
            terminal=self._integrand("terminal", ends),
            t0=t0,
            tf=tf,
            x=x,
            u=u,
            x0=self._end("x0_bounds", "x_bounds", x, names[0]),
            xf=self._end("xf_bounds", "x_bounds", x, names[0]),
            u0=self._end("u0_bounds", "u_bounds", u, names[1]),
            uf=self._end("uf_bounds", "u_bounds", u, names[1]),
            p=self._pair("parameter_bounds", names[2]),
            h_bounds=h_bounds,
            at_start=at_start,
            at_end=at_end,
            start_bounds=start_bounds,
            end_bounds=end_bounds,
            g_bounds=g_bounds,
            x_names=names[0],
            u_names=names[1],
            p_names=names[2],
        )
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "start", make_guess("Problem", phase, self.guess))

    def __repr__(self) -> str:
        return f"<Problem: {self.nx} states, {self.nu} controls, {self.parameters} parameters>"

    def _pair(self, argument: str, names: Sequence[str]) -> Pair:
        return pair("Problem", argument, getattr(self, argument), names)

    def _end(self, argument: str, outer: str, along: Pair, names: Sequence[str]) -> Pair:
        return both("Problem", f"{argument} and {outer}", along, self._pair(argument, names), names)

    def _times(self) -> tuple[tuple[float, float], tuple[float, float]]:
        bounds = []
        for name, default in (("t0", 0.0), ("tf", None)):
            value, free = getattr(self, name), getattr(self, f"{name}_bounds")
            if value is not None and free is not None:
                raise ArgumentError(f"Problem: {name} and {name}_bounds are given, expected one")
            if free is not None:
                lower, upper = pair("Problem", f"{name}_bounds", free, [name])
                bounds.append((float(lower[0]), float(upper[0])))
                continue
            if value is None and default is None:
                raise ArgumentError("Problem: tf or tf_bounds is needed: when does the motion end?")
            fixed = number("Problem", name, default if value is None else value)
            bounds.append((fixed, fixed))
        if bounds[1][1] <= bounds[0][0]:
            raise ArgumentError(
                f"Problem: tf <= {bounds[1][1]:g} leaves no time after t0 >= {bounds[0][0]:g}"
            )
        return bounds[0], bounds[1]

    def _integrand(self, argument: str, inputs: tuple[tuple[str, int], ...]) -> Any:
        """Return the trace of a function with one value, or of none."""
        given = getattr(self, argument)
        if given is None:
            return _absent(argument, inputs, 1)
        return trace("Problem", argument, given, inputs, 1)

    def _periods(self, names: Sequence[str]) -> list[int]:
        if isinstance(self.periodic, bool):
            return list(range(self.nx)) if self.periodic else []
        chosen = [whole("Problem", "periodic", i, 0) for i in self.periodic]
        if any(i >= self.nx for i in chosen):
            raise ArgumentError(
                f"Problem: periodic = {chosen}, expected indices below nx = {len(names)}"
            )
        return chosen

    def _constraint(
        self, argument: str, inputs: tuple[tuple[str, int], ...], periods: list[int]
    ) -> tuple[Any, Pair]:
        """Trace a constraint; `periods` adds rows xf - x0 = 0 of these states."""
        given = getattr(self, argument)
        if given is None and not periods:
            return _absent(argument, inputs, 0), (np.zeros(0), np.zeros(0))
        if given is None:
            function, lower, upper = _no_rows, [], []
        else:
            if not isinstance(given, (tuple, list)) or len(given) != 3:
                raise ArgumentTypeError(
                    f"Problem: {argument} must be (function, lower, upper), not {given!r}"
                )
            function, lower, upper = given

        def rows(*values: Any) -> list[Any]:
            own = function(*values)
            return [own, [values[3][i] - values[2][i] for i in periods]] if periods else own

        traced = trace("Problem", argument, rows if periods else function, inputs, None)
        count = traced.numel_out(0) - len(periods)
        names = [f"{argument}[{i}]" for i in range(count)]
        low, high = pair("Problem", f"the bounds of {argument}", (lower, upper), names)
        zeros = np.zeros(len(periods))
        return traced, (np.concatenate([low, zeros]), np.concatenate([high, zeros]))


@cache
def _absent(argument: str, inputs: tuple[tuple[str, int], ...], rows: int) -> Any:
    """Return the trace of a function that was not given: `rows` zeros."""
    return trace("Problem", argument, lambda *_: [0.0] * rows, inputs, rows)


def _no_rows(*values: Any) -> list[Any]:
    del values
    return []


def _names(argument: str, letter: str, given: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if given is None:
        return tuple(f"{letter}[{i}]" for i in range(count))
    names = tuple(given)
    if isinstance(given, str) or len(names) != count or not all(isinstance(n, str) for n in names):
        raise ArgumentError(f"Problem: {argument} = {given!r}, expected {count} names")
    return names
