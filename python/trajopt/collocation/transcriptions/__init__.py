"""Transcriptions: one file per method, all behind `Transcription`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from trajopt.checks import choice, whole
from trajopt.collocation.transcriptions.base import Segment, Transcription
from trajopt.collocation.transcriptions.hermite_simpson import (
    HermiteSimpson,
    HermiteSimpsonCompressed,
)
from trajopt.collocation.transcriptions.mixed import Mixed
from trajopt.collocation.transcriptions.multiple_shooting import MultipleShooting
from trajopt.collocation.transcriptions.orthogonal import Orthogonal, chebyshev, legendre
from trajopt.collocation.transcriptions.trapezoidal import Trapezoidal
from trajopt.errors import ArgumentError

__all__ = ["METHODS", "Segment", "Transcription", "make_transcription"]

METHODS = (
    "trapezoidal",
    "hermite_simpson",
    "hermite_simpson_compressed",
    "multiple_shooting",
    "chebyshev",
    "legendre",
)
POINTS = ("gauss", "radau", "lobatto")
DEGREE = 4


def make_transcription(
    method: str,
    degree: int | Sequence[int] | None = None,
    points: str | None = None,
    substeps: int | None = None,
    segments: int | None = None,
) -> Transcription:
    """Return the transcription of a name.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    degree : int or sequence of int, optional
        For ``chebyshev`` and ``legendre``: polynomial degree of all segments, 4 unless given, or
        one of every segment.
    points : str, optional
        For ``legendre``: ``gauss``, ``radau`` (default) or ``lobatto``.
    substeps : int, optional
        For ``multiple_shooting``: Runge–Kutta steps per segment, 4 unless given.
    segments : int, optional
        How many degrees there have to be.

    Raises
    ------
    ArgumentError
        For an unknown method, or an option that the method does not have.

    Examples
    --------
    >>> make_transcription("legendre", degree=2, points="lobatto").points
    (0.0, 0.5, 1.0)
    """
    method = choice("solve", "method", method, METHODS)
    options = {"degree": degree, "points": points, "substeps": substeps}
    known = {
        "chebyshev": ("degree",),
        "legendre": ("degree", "points"),
        "multiple_shooting": ("substeps",),
    }.get(method, ())
    for name, value in options.items():
        if value is not None and name not in known:
            raise ArgumentError(f"solve: {name} = {value!r} is no option of method {method!r}")
    if method == "multiple_shooting":
        return MultipleShooting(whole("solve", "substeps", 4 if substeps is None else substeps, 1))
    if method in ("chebyshev", "legendre"):
        kind = choice("solve", "points", "radau" if points is None else points, POINTS)
        family = chebyshev if method == "chebyshev" else partial(legendre, points=kind)
        return _orthogonal(family, DEGREE if degree is None else degree, segments)
    simple = (Trapezoidal, HermiteSimpson, HermiteSimpsonCompressed)
    return next(kind() for kind in simple if kind.name == method)


def _orthogonal(family: Any, degree: int | Sequence[int], segments: int | None) -> Transcription:
    """Return one method for all segments, or one with a degree for every segment."""
    if not np.ndim(degree):
        found: Orthogonal = family(whole("solve", "degree", degree, 1))
        return found
    assert not isinstance(degree, int)
    degrees = [whole("solve", f"degree[{k}]", n, 1) for k, n in enumerate(degree)]
    if not degrees or len(degrees) != (segments or len(degrees)):
        raise ArgumentError(
            f"solve: degree has {len(degrees)} entries, expected one for each of the "
            f"{segments} segments"
        )
    return Mixed(family, degrees) if len(set(degrees)) > 1 else family(degrees[0])
