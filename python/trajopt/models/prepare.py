"""Repair what files in the wild get wrong, and compile."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import ModelError, ModelWarning
from trajopt.models.messages import listing, one_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trajopt.models.source import Source

__all__ = ["compile_spec", "free_mimics", "repair_inertias"]

# MuJoCo wants mass on every body with a joint; links without any get this and are zeroed later.
_MASSLESS = 1e-12
# Share of the trace by which rounding in a file may make an inertia impossible without a word.
_ROUNDING = 1e-3


def repair_inertias(source: Source) -> None:
    """Replace inertias that no body can have by the nearest possible ones.

    A body's second moment Σ = ½ tr(I) 1 − I has no negative eigenvalue; those of Σ that are
    negative (which is where principal moments violate A + B >= C) are set to zero.

    Warns
    -----
    ModelWarning
        Once, naming the bodies, unless only rounding was repaired.
    """
    repaired = []
    for body in source.spec.bodies:
        if not body.explicitinertial:
            continue
        if np.isfinite(body.fullinertia[0]):
            xx, yy, zz, xy, xz, yz = body.fullinertia
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            inertia = np.diag(body.inertia)
        possible, error = _possible(inertia)
        if error == 0:
            continue
        if error > _ROUNDING:
            repaired.append(body.name)
        if np.isfinite(body.fullinertia[0]):
            body.fullinertia = [*np.diag(possible), possible[0, 1], possible[0, 2], possible[1, 2]]
        else:
            body.inertia = np.diag(possible)
    if repaired:
        warnings.warn(
            f"{source.label}: no body can have the inertia of {listing(repaired)} (principal"
            " moments violate A + B >= C); the nearest possible one is used",
            ModelWarning,
            stacklevel=3,
        )


def _possible(inertia: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Nearest possible inertia, and by what share of the trace the given one is off."""
    trace = float(np.trace(inertia))
    if not np.isfinite(inertia).all() or trace <= 0:
        return inertia, 0.0  # zero, or left to the compiler to refuse
    second, axes = np.linalg.eigh(0.5 * trace * np.eye(3) - inertia)
    if second[0] >= 0:
        return inertia, 0.0
    # A trace of thickness, because the compiler refuses a principal moment of exactly zero.
    clipped = np.maximum(second, 1e-9 * trace)
    possible = clipped.sum() * np.eye(3) - (axes * clipped) @ axes.T
    return possible, float(-second[0]) / trace


def free_mimics(source: Source) -> None:
    """Let the mimic joints of a URDF move on their own, as most robotics libraries do.

    Warns
    -----
    ModelWarning
        Once, naming the joints.
    """
    import mujoco

    if not source.urdf:
        return
    joints = []
    for equality in list(source.spec.equalities):
        if equality.type == mujoco.mjtEq.mjEQ_JOINT:
            joints.append(equality.name1)
            source.spec.delete(equality)
    if joints:
        warnings.warn(
            f"{source.label}: mimic joints move on their own: {listing(joints)}",
            ModelWarning,
            stacklevel=3,
        )


def compile_spec(source: Source) -> Any:
    """Compile, allowing links without mass.

    Returns
    -------
    mujoco.MjModel

    Raises
    ------
    ModelError
        With the compiler's message on one line.
    """
    spec = source.spec
    spec.compiler.fusestatic = False  # merging is done on joints, and names stay
    spec.compiler.boundmass = max(spec.compiler.boundmass, _MASSLESS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, _MASSLESS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # advice to the author of the file
            m = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{source.label}: {one_line(error)}") from error
    massless = m.body_mass <= 2 * _MASSLESS
    m.body_mass[massless] = 0.0
    m.body_inertia[massless] = 0.0
    _check_numbers(m, source.label)
    return m


# What is read of a compiled model, and the largest number that makes sense in it.
_NUMBERS = {
    "body": ("pos", "quat", "mass", "inertia", "ipos", "iquat"),
    "joint": ("pos", "axis", "range"),
    "geom": ("pos", "quat", "size"),
    "key": ("qpos",),
}
_LARGEST = 1e9


def _check_numbers(m: Any, label: str) -> None:
    """Refuse NaN, infinity and absurd sizes, which the compiler lets pass."""
    for kind, attributes in _NUMBERS.items():
        for attribute in attributes:
            array = getattr(m, f"{'jnt' if kind == 'joint' else kind}_{attribute}")
            rows = array[:, None] if array.ndim == 1 else array
            for i in np.flatnonzero(~(np.abs(rows) < _LARGEST).all(axis=1)):
                name = getattr(m, kind)(int(i)).name or f"number {i}"
                raise ModelError(
                    f"{label}: {attribute} of {kind} {name} holds"
                    f" {rows[i][~(np.abs(rows[i]) < _LARGEST)][0]:g}; expected a number below"
                    f" {_LARGEST:g}"
                )
