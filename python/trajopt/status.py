"""How a solve ended."""

from __future__ import annotations

from enum import Enum

__all__ = ["Status"]


class Status(str, Enum):
    """Reason why the solver stopped; compares equal to its name as a string.

    Examples
    --------
    >>> Status("solved") is Status.SOLVED
    True
    >>> Status.STALLED == "stalled"
    True
    >>> print(Status.STALLED, "-", Status.STALLED.meaning)
    stalled - steps became too small before the tolerances were met
    """

    SOLVED = "solved"
    MAX_ITERATIONS = "max_iterations"
    STALLED = "stalled"
    INTERRUPTED = "interrupted"
    INFEASIBLE = "infeasible"
    NUMERICAL_FAILURE = "numerical_failure"

    def __str__(self) -> str:
        return self.value

    @property
    def meaning(self) -> str:
        """What the status says, in one line."""
        return _MEANINGS[self]

    @property
    def converged(self) -> bool:
        """Whether all tolerances were met."""
        return self is Status.SOLVED


_MEANINGS = {
    Status.SOLVED: "all tolerances were met",
    Status.MAX_ITERATIONS: "the iteration limit was reached before the tolerances were met",
    Status.STALLED: "steps became too small before the tolerances were met",
    Status.INTERRUPTED: "stopped by the user; the best iterate was kept",
    Status.INFEASIBLE: "no motion nearby satisfies the dynamics",
    Status.NUMERICAL_FAILURE: "a factorization or evaluation broke down",
}
