"""A term of an objective, as all of them are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from trajopt.checks import finite_array, non_negative

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder

__all__ = ["Term", "Times", "Vector"]

Vector = Sequence[float]
Times = float | Sequence[float] | None


@dataclass(frozen=True)
class Term:
    """What all terms have in common."""

    task: ClassVar[bool] = True

    def __post_init__(self) -> None:
        non_negative(type(self).__name__, "weight", getattr(self, "weight", 1.0))
        axes = getattr(self, "axes", None)
        if axes is not None:
            finite_array(type(self).__name__, "axes", axes, (3,))

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        raise NotImplementedError
