"""Problems of several phases, each with its own functions, linked where they meet (Kelly, 9.9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.checks import whole
from trajopt.collocation.assembly import Link
from trajopt.collocation.bounds import pair
from trajopt.collocation.problem import Problem
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.status import Status
from trajopt.tracing import casadi, trace

if TYPE_CHECKING:
    from trajopt.collocation.solution import Pass, Solution

__all__ = ["MultiPhase", "MultiPhaseSolution", "PhaseLink"]


@dataclass(frozen=True, kw_only=True)
class PhaseLink:
    """Rows ``lower <= function(tf, xf, t0, x0) <= upper`` between two phases.

    Parameters
    ----------
    first, second : int
        Phase whose end (tf, xf) and phase whose start (t0, x0) are linked.
    function : callable
        ``function(tf, xf, t0, x0)`` -> values, such as an impact map ``[x0[1] + 0.8 * xf[1]]``.
    lower, upper : number or sequence
        Bounds; 0 unless given.
    """

    first: int
    second: int
    function: Callable[..., Any]
    lower: Any = 0.0
    upper: Any = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class MultiPhase:
    """Several phases in one optimization; the objective is the sum of theirs.

    Parameters
    ----------
    phases : sequence of Problem
        Stretches of motion; states, controls and functions may differ from phase to phase.
    links : sequence of PhaseLink, optional
        Default: every phase begins when and in the state in which the one before it ended.

    Examples
    --------
    A ball falls by one meter and bounces: half of the speed remains.

    >>> from trajopt import collocation as col
    >>> def fall(**bounds):
    ...     return col.Problem(
    ...         dynamics=lambda t, x, u: [x[1], -9.81],
    ...         nx=2,
    ...         nu=0,
    ...         t0_bounds=(0, 2),
    ...         tf_bounds=(0.1, 3),
    ...         **bounds,
    ...     )
    >>> down = fall(x0_bounds=([1, 0], [1, 0]), xf_bounds=([0, None], [0, 0]))
    >>> up = fall(x0_bounds=([0, 0], [0, None]), xf_bounds=([None, 0], [None, 0]))
    >>> bounce = col.PhaseLink(
    ...     first=0, second=1, function=lambda tf, xf, t0, x0: [t0 - tf, x0[1] + 0.5 * xf[1]]
    ... )
    >>> found = col.solve(col.MultiPhase([down, up], [bounce]), segments=4)
    >>> round(float(found.phases[1].x[-1, 0]), 6)
    0.25
    """

    phases: Sequence[Problem]
    links: Sequence[PhaseLink] | None = None
    traced: tuple[Link, ...] = field(init=False)

    def __post_init__(self) -> None:
        if not self.phases or not all(isinstance(phase, Problem) for phase in self.phases):
            raise ArgumentTypeError("MultiPhase: phases must be a sequence of Problem")
        links = self._continuous() if self.links is None else list(self.links)
        object.__setattr__(self, "traced", tuple(self._trace(link) for link in links))

    def __repr__(self) -> str:
        return f"<MultiPhase: {len(self.phases)} phases, {len(self.traced)} links>"

    def _continuous(self) -> list[PhaseLink]:
        links = []
        for k, (before, after) in enumerate(zip(self.phases, self.phases[1:], strict=False)):
            if before.nx != after.nx:
                raise ArgumentError(
                    f"MultiPhase: phases {k} and {k + 1} have {before.nx} and {after.nx} states; "
                    "links must say how they meet"
                )
            links.append(PhaseLink(first=k, second=k + 1, function=_same))
        return links

    def _trace(self, link: PhaseLink) -> Link:
        ends = []
        for name in ("first", "second"):
            index = whole("PhaseLink", name, getattr(link, name), 0)
            if index >= len(self.phases):
                raise ArgumentError(
                    f"PhaseLink: {name} = {index}, expected a phase below {len(self.phases)}"
                )
            ends.append(self.phases[index].phase)
        first, second = ends
        inputs = (("tf", -1), ("xf", first.nx), ("t0", -1), ("x0", second.nx))
        inner = trace("PhaseLink", "function", link.function, inputs, None)
        count = inner.numel_out(0)
        names = [f"link of phases {link.first} and {link.second}[{i}]" for i in range(count)]
        lower, upper = pair("PhaseLink", "bounds", (link.lower, link.upper), names)
        # The assembly passes parameters too.
        symbols = [casadi.SX.sym(n, size) for n, size in (
            ("tf", 1), ("xf", first.nx), ("p", first.np),
            ("t0", 1), ("x0", second.nx), ("q", second.np),
        )]  # fmt: skip
        tf, xf, _, t0, x0, _ = symbols
        function = casadi.Function("link", symbols, [inner(tf, xf, t0, x0)])
        name = f"link of phases {link.first} and {link.second}"
        return Link(link.first, link.second, function, lower, upper, name)


def _same(tf: Any, xf: Any, t0: Any, x0: Any) -> list[Any]:
    return [t0 - tf, x0 - xf]


@dataclass(eq=False, repr=False)
class MultiPhaseSolution:
    """The trajectories of all phases.

    Parameters
    ----------
    phases : list of Solution
        One per phase, each with its own part of the objective.
    objective : float
        Their sum.
    status : Status
    message : str
    iterations : int
    seconds : float
    result : dict
        What the solver returned: unknowns and multipliers, for a warm start on the same meshes.
    """

    phases: list[Solution]
    objective: float
    status: Status
    message: str
    iterations: int
    seconds: float
    result: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"<MultiPhaseSolution: {len(self.phases)} phases, {self.status}, "
            f"objective {self.objective:.8g}>"
        )

    @property
    def converged(self) -> bool:
        """Whether the tolerances were met."""
        return self.status.converged

    @property
    def passes(self) -> list[tuple[Pass, ...]]:
        """One entry per solve of a mesh refinement, with the `Pass` of every phase in it."""
        return list(zip(*(phase.passes for phase in self.phases), strict=True))

    @property
    def switching_times(self) -> Any:
        """Times at which one phase ends and the next begins [s]."""
        return np.array([phase.t[-1] for phase in self.phases[:-1]])
