"""A term that is a function of the user."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from trajopt.errors import ArgumentTypeError
from trajopt.objectives.base import Term

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder
    from trajopt.traced import Trace

__all__ = ["Residual"]


@dataclass(frozen=True)
class Residual(Term):
    """A residual of your own: a function of three consecutive frames, traced once with CasADi.

    Parameters
    ----------
    function : callable
        ``f(x2, x1, x)`` with the coordinates of frames i-2, i-1 and i [m, rad] as arrays of D
        symbols: NumPy functions and arithmetic, no branches on values. Returns one expression or
        a sequence. It is called once for a model's number of coordinates, when it is first added.
    weight : float
        Factor of the mean square.
    name : str
        Name in tables and plots.

    Examples
    --------
    >>> wave = Residual(lambda x2, x1, x: x[7] - 0.3, weight=0.1, name="bent knee")
    """

    task: ClassVar[bool] = False
    function: Callable[[Any, Any, Any], Any] = field(repr=False)
    weight: float = 1.0
    name: str = "residual"
    _traces: dict[int, Trace] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.function):
            raise ArgumentTypeError(
                f"Residual: function must be a function f(x2, x1, x), not {self.function!r}"
            )
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentTypeError(f"Residual: name must be a string, not {self.name!r}")

    def trace(self, ndof: int) -> Trace:
        """Return the function, traced for frames of `ndof` coordinates."""
        from trajopt.traced import Trace

        if ndof not in self._traces:
            self._traces[ndof] = Trace(self.name, self.function, ndof)
        return self._traces[ndof]

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.traced(self.trace(build.model.ndof), self.weight)
