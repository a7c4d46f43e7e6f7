"""Every error that trajopt raises on purpose, and the one warning category of its loader.

All of them derive from :class:`TrajoptError`, so one ``except`` clause separates a problem with
the input from a defect of the program.  Those about arguments also derive from the built-in that a
Python programmer expects (``ValueError``, ``TypeError``, ``ImportError``), those about devices from
``RuntimeError``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trajopt.solution import Solution

__all__ = [
    "ArgumentError",
    "ArgumentTypeError",
    "BatchError",
    "DeviceError",
    "FactorizationError",
    "MissingDependencyError",
    "ModelError",
    "ModelWarning",
    "TrajoptError",
]


class TrajoptError(Exception):
    """Base class of all errors raised by trajopt."""


class ArgumentError(TrajoptError, ValueError):
    """An argument has a value (sign, range, shape, NaN) that cannot be used."""


class ArgumentTypeError(TrajoptError, TypeError):
    """An argument has a type that cannot be used."""


class ModelError(TrajoptError, ValueError):
    """A model file is missing, malformed, or holds something that cannot be represented."""


class FactorizationError(TrajoptError):
    """A block matrix could not be factored.

    Parameters
    ----------
    message : str
        One line that says what happened.
    block : int, optional
        Index of the diagonal block in which the factorization broke down.
    pivot : int, optional
        Row inside that block.

    Examples
    --------
    >>> try:
    ...     raise FactorizationError("pivot 0.0 has the wrong sign", block=3, pivot=1)
    ... except FactorizationError as error:
    ...     print(error.block, error.pivot)
    3 1
    """

    def __init__(self, message: str, block: int | None = None, pivot: int | None = None) -> None:
        super().__init__(message)
        self.block = block
        self.pivot = pivot


class DeviceError(TrajoptError, RuntimeError):
    """The requested device is not there, out of memory, or not supported by this build."""


class BatchError(TrajoptError):
    """Some problems of a batch raised exceptions; the others were solved to their ends.

    Parameters
    ----------
    solutions : list of Solution or None
        What was found, by index; None where an exception was raised.
    errors : dict of int to Exception
        The exceptions, by index.

    Examples
    --------
    >>> print(BatchError([None, None], {0: ValueError("too high"), 1: ValueError("too low")}))
    2 of 2 problems failed: problems[0]: ValueError: too high (and 1 more)
    """

    def __init__(
        self, solutions: Sequence[Solution | None], errors: Mapping[int, Exception]
    ) -> None:
        super().__init__(solutions, errors)
        self.solutions = list(solutions)
        self.errors = dict(errors)

    def __str__(self) -> str:
        index, error = min(self.errors.items())
        more = f" (and {len(self.errors) - 1} more)" if len(self.errors) > 1 else ""
        return (
            f"{len(self.errors)} of {len(self.solutions)} problems failed: "
            f"problems[{index}]: {type(error).__name__}: {error}{more}"
        )


class MissingDependencyError(TrajoptError, ImportError):
    """An optional package is needed; the message holds the ``pip`` command that installs it.

    Parameters
    ----------
    package : str
        Name of the missing package.
    purpose : str
        What it is needed for, as the start of a sentence.
    extra : str, optional
        The extra of ``contact-trajopt`` that brings the package.

    Examples
    --------
    >>> print(MissingDependencyError("matplotlib", "Plotting", extra="plot"))
    Plotting needs the package 'matplotlib': pip install 'contact-trajopt[plot]'
    """

    def __init__(self, package: str, purpose: str, extra: str | None = None) -> None:
        what = package if extra is None else f"'contact-trajopt[{extra}]'"
        super().__init__(f"{purpose} needs the package '{package}': pip install {what}")


class ModelWarning(UserWarning):
    """Something in a model file was ignored or replaced; the model is usable."""
