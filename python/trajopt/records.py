"""What one solver iteration reports; printing, checkpoints and plots are observers of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trajopt.solution import Solution

__all__ = ["IterationRecord", "Observer", "continued"]


@dataclass(frozen=True)
class IterationRecord:
    """State of the solver after one iteration.

    Parameters
    ----------
    iteration : int
        Number of the iteration, counted from 1 over all stages; 0 is the start.
    stage : int
        Stage of the solve (stiffness and friction schedule, feasibility), counted from 0.
    objective : float
        Weighted sum of all objective terms (dimensionless).
    objective_terms : dict of str to float
        The same by name of the term.
    constraint_violation : float
        Largest absolute value of the (reduced) dynamics constraints [N, N·m].
    frame_violation : float
        Largest unactuated residual of any frame, as a share of the body weight.
    merit_penalty : float
        Weight μ of the constraints in the merit function.
    radius : float
        Trust-region radius [m, rad].
    damping : float
        Levenberg–Marquardt damping λ (0 for a pure trust region).
    step_norm : float
        Norm of the step that was tried, in the norm of `radius`.
    accepted : bool
        Whether the step was taken.
    seconds : dict of str to float
        Time spent in the phases ``dynamics``, ``assembly``, ``factorization``, ``solve`` [s].
    elapsed : float
        Time since the start of the solve [s].
    snapshot : callable, optional
        Returns the best iterate so far as a `Solution`. Only there while a callback looks at the
        record: histories and files do not keep it.

    Examples
    --------
    >>> record = IterationRecord(iteration=3, stage=0, objective=0.5, accepted=True)
    >>> IterationRecord.from_dict(record.to_dict()) == record
    True
    """

    iteration: int
    stage: int = 0
    objective: float = float("nan")
    objective_terms: dict[str, float] = field(default_factory=dict)
    constraint_violation: float = float("nan")
    frame_violation: float = float("nan")
    merit_penalty: float = float("nan")
    radius: float = float("nan")
    damping: float = 0.0
    step_norm: float = float("nan")
    accepted: bool = True
    seconds: dict[str, float] = field(default_factory=dict)
    elapsed: float = 0.0
    snapshot: Callable[[], Solution] | None = field(default=None, repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain Python values, without `snapshot`."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "snapshot"}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> IterationRecord:
        """Build a record from `to_dict`'s mapping; fields of newer versions are ignored."""
        known = {f.name for f in fields(cls)} - {"snapshot"}
        return cls(**{name: value for name, value in values.items() if name in known})


Observer = Callable[[IterationRecord], object]
"""A function called once an iteration; returning True asks the solver to stop."""


def continued(
    before: Sequence[IterationRecord], after: Sequence[IterationRecord]
) -> list[IterationRecord]:
    """Return the history of a solve that was resumed, numbered and timed through.

    Parameters
    ----------
    before, after : sequences of IterationRecord
        Histories up to the checkpoint and from it on.

    Returns
    -------
    list of IterationRecord

    Examples
    --------
    >>> first = [IterationRecord(k, elapsed=0.1 * k) for k in range(3)]
    >>> [r.iteration for r in continued(first, [IterationRecord(0), IterationRecord(1)])]
    [0, 1, 2, 2, 3]
    """
    if not before:
        return list(after)
    last = before[-1]
    shifted = (
        replace(r, iteration=r.iteration + last.iteration, elapsed=r.elapsed + last.elapsed)
        for r in after
    )
    return [*before, *shifted]
