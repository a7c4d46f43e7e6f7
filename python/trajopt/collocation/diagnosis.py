"""Why a problem could not be solved: constraints that fail, and limits it ran into (Kelly, 5.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.staged import StagedNLP
from trajopt.errors import ArgumentError

__all__ = ["Violation", "check_start", "explain", "find_violations", "limits_reached"]

FloatArray = NDArray[np.float64]

# Violations below this are roundoff of a solver that has done its work.
NOTICED = 1e-6
LARGEST = float(np.finfo(np.float64).max)
# A variable within this share of its range counts as being at its bound.
TOUCHING = 1e-4


@dataclass(frozen=True)
class Violation:
    """A constraint that does not hold.

    Parameters
    ----------
    name : str
    time : float
        Start of the segment concerned, as far as the constraint has one [s]; NaN otherwise.
    value, lower, upper : float
    amount : float
        How far `value` is outside.
    """

    name: str
    time: float
    value: float
    lower: float
    upper: float
    amount: float

    def __str__(self) -> str:
        when = "" if np.isnan(self.time) else f" at t = {self.time:.4g} s"
        bounds = (
            f"= {self.lower:g}"
            if self.lower == self.upper
            else f"in [{self.lower:g}, {self.upper:g}]"
        )
        return f"{self.name}{when}: {self.value:.4g}, expected {bounds} (off by {self.amount:.2g})"


def find_violations(
    nlp: StagedNLP,
    w: FloatArray,
    p: FloatArray,
    times: Mapping[str, FloatArray],
    above: float = NOTICED,
) -> list[Violation]:
    """Return all violated constraints and bounds, worst first.

    Parameters
    ----------
    nlp : StagedNLP
    w, p : arrays
        Where to look.
    times : dict of str to (n,) array
        Times of the nodes [s], by the prefix of names that belong to a phase.
    above : float
        Violations up to this are left out.
    """
    values, names = nlp.evaluate(w, p), nlp.names
    last, glob = values.last[None], values.glob[None]
    found: list[Violation] = []
    for labels, first, value, lower, upper in (
        (names.stage, 0, values.stage, nlp.c_lower, nlp.c_upper),
        (names.last, nlp.n - 1, last, nlp.last_lower[None], nlp.last_upper[None]),
        (names.glob, None, glob, nlp.glob_lower[None], nlp.glob_upper[None]),
        (names.w, 0, w, nlp.w_lower, nlp.w_upper),
        (names.p, None, p[None], nlp.p_lower[None], nlp.p_upper[None]),
    ):
        amount = np.maximum(lower - value, value - upper)
        # NaN is a violation too.
        for k, i in np.argwhere(~(amount <= above)):
            own = [t for prefix, t in times.items() if labels[i].startswith(prefix)]
            when = float(own[0][first + k]) if own and first is not None else float("nan")
            found.append(
                Violation(
                    name=labels[i],
                    time=when,
                    value=float(value[k, i]),
                    lower=float(lower[k, i]),
                    upper=float(upper[k, i]),
                    amount=float(amount[k, i]),
                )
            )
    return sorted(found, key=lambda v: -np.inf if np.isnan(v.amount) else -v.amount)


def check_start(nlp: StagedNLP, times: Mapping[str, FloatArray]) -> None:
    """Raise if cost or constraints are not finite at the guess, naming where."""
    if not np.isfinite(nlp.evaluate(nlp.w_guess, nlp.p_guess).cost):
        raise ArgumentError(
            "solve: the objective is not finite for the guess; start where it is defined"
        )
    values = find_violations(nlp, nlp.w_guess, nlp.p_guess, times, above=LARGEST)
    if values:
        raise ArgumentError(
            f"solve: {values[0].name} is {values[0].value:g} for the guess"
            + ("" if np.isnan(values[0].time) else f" at t = {values[0].time:.4g} s")
            + "; start where the functions are defined"
        )


def limits_reached(nlp: StagedNLP, w: FloatArray) -> list[str]:
    """Return one line for every unknown that lies at a bound along much of the path."""
    lines = []
    for i, name in enumerate(nlp.names.w):
        lower, upper = nlp.w_lower[:, i], nlp.w_upper[:, i]
        free = lower < upper
        bounded = free & (np.isfinite(lower) | np.isfinite(upper))
        if not bounded.any():
            continue
        room = np.where(np.isfinite(upper - lower), upper - lower, 1.0)
        at = bounded & ((w[:, i] - lower <= TOUCHING * room) | (upper - w[:, i] <= TOUCHING * room))
        share = at.sum() / bounded.sum()
        if share >= 0.25:
            limits = f"[{lower[bounded][0]:g}, {upper[bounded][0]:g}]"
            lines.append(f"{name} is at a limit of {limits} at {100 * share:.0f} % of the nodes")
    return lines


def explain(violations: Sequence[Violation], limits: Sequence[str], count: int = 3) -> str:
    """Return a sentence on what is in the way of a solution."""
    if not violations:
        return ""
    worst = "; ".join(str(violation) for violation in violations[:count])
    more = f" (and {len(violations) - count} more)" if len(violations) > count else ""
    text = f"most violated: {worst}{more}"
    return text + (f". {'; '.join(limits[:2])}" if limits else "")
