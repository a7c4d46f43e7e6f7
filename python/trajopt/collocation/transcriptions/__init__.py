"""Transcriptions: one file per method, all behind `Transcription`."""

from __future__ import annotations

from trajopt.checks import choice, whole
from trajopt.collocation.transcriptions.base import Segment, Transcription
from trajopt.collocation.transcriptions.hermite_simpson import (
    HermiteSimpson,
    HermiteSimpsonCompressed,
)
from trajopt.collocation.transcriptions.multiple_shooting import MultipleShooting
from trajopt.collocation.transcriptions.orthogonal import chebyshev, legendre
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
    method: str, degree: int | None = None, points: str | None = None, substeps: int | None = None
) -> Transcription:
    """Return the transcription of a name.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    degree : int, optional
        For ``chebyshev`` and ``legendre``: polynomial degree of a segment, 4 unless given.
    points : str, optional
        For ``legendre``: ``gauss``, ``radau`` (default) or ``lobatto``.
    substeps : int, optional
        For ``multiple_shooting``: Runge–Kutta steps per segment, 4 unless given.

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
        degree = whole("solve", "degree", DEGREE if degree is None else degree, 1)
        if method == "chebyshev":
            return chebyshev(degree)
        kind = choice("solve", "points", "radau" if points is None else points, POINTS)
        return legendre(degree, kind)
    simple = (Trapezoidal, HermiteSimpson, HermiteSimpsonCompressed)
    return next(kind() for kind in simple if kind.name == method)
