"""One time step: solve the dynamics residual of three frames for the newest one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from trajopt.errors import TrajoptError
from trajopt.kinematics import ball_slices

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.world import Contact, World

__all__ = ["SimulationError", "Stepper"]

FloatArray = NDArray[np.float64]

# A step has to shrink the next one to this share, or the Jacobian is computed anew.
_CONTRACTION = 0.25
# Updates below this size [m, rad] that no longer shrink are rounding, not divergence.
_ROUNDING = 1e-9
# Steps cut to a smaller share than this lead nowhere.
_SHORTEST = 1e-4


class SimulationError(TrajoptError, RuntimeError):
    """A time step had no solution that Newton's method could find."""


@dataclass(frozen=True)
class Setting:
    """World, contact law and time scheme, as `Model.dynamics_residual` takes them."""

    world: World | None = None
    contact: Contact | None = None
    integrator: str = "linear_acceleration"


class Stepper:
    """Newton's method on some rows of the residual and the coordinates of the same numbers.

    The inverse Jacobian is kept over iterations and steps as long as it contracts the error by
    `_CONTRACTION`; a step that does not contract in its norm (Deuflhard's natural monotonicity,
    which needs no units) is halved.

    Parameters
    ----------
    model : Model
        Character with D degrees of freedom.
    setting : Setting
        World, contact law and time scheme.
    free : (F,) array of int, optional
        Coordinates to solve for; all of them when not given. The others keep the value guessed.
    tolerance : float, optional
        Error of a coordinate at which a step ends, relative to 1 m, 1 rad or its size.
    max_iterations : int, optional
        Newton iterations before a step is given up.
    """

    def __init__(
        self,
        model: Model,
        setting: Setting,
        free: NDArray[np.intp] | None = None,
        tolerance: float = 1e-13,
        max_iterations: int = 50,
    ) -> None:
        self.model = model
        self.setting = setting
        self.free = np.arange(model.ndof) if free is None else np.asarray(free)
        self.tolerance = tolerance
        self.max_iterations = max_iterations
        self._inverse: FloatArray | None = None
        self._balls = ball_slices(model)

    def residual(self, x: FloatArray, x1: FloatArray, x2: FloatArray, dt: float) -> FloatArray:
        """Return the residual (B, D) of frames i, i-1, i-2 [N, N·m]."""
        s = self.setting
        return np.asarray(
            self.model.dynamics_residual(
                x, x1, x2, dt, world=s.world, contact=s.contact, integrator=s.integrator
            )
        )

    def _invert(self, x: FloatArray, x1: FloatArray, x2: FloatArray, dt: float) -> FloatArray:
        s = self.setting
        jacobian = self.model.dynamics_jacobians(
            x, x1, x2, dt, world=s.world, contact=s.contact, integrator=s.integrator
        )[0]
        try:
            return np.asarray(np.linalg.inv(jacobian[:, self.free[:, None], self.free]))
        except np.linalg.LinAlgError as error:
            raise SimulationError(f"the Jacobian of a step of {dt:g} s is singular") from error

    def advance(
        self, guess: FloatArray, x1: FloatArray, x2: FloatArray, dt: float, force: FloatArray
    ) -> FloatArray:
        """Return the frame whose residual equals `force` on the free rows.

        Parameters
        ----------
        guess : (B, D) array
            Start of the iteration [m, rad].
        x1, x2 : (B, D) arrays
            The two frames before it [m, rad].
        dt : float
            Time step [s].
        force : (B, D) array
            Generalized force applied [N, N·m]; only the free entries are used.

        Returns
        -------
        (B, D) array
            The new frame [m, rad], rotation vectors at most π long.

        Raises
        ------
        SimulationError
            If Newton's method does not converge for one of the B members.
        """
        x = self.wrapped(guess)

        def gap(x: FloatArray) -> FloatArray:
            return (self.residual(x, x1, x2, dt) - force)[:, self.free]

        inverse, fresh = self._inverse, False
        if inverse is None or len(inverse) != len(x):
            inverse, fresh = self._invert(x, x1, x2, dt), True
        step = -_apply(inverse, gap(x))
        length = np.ones(len(x))  # share of the step that each member takes
        for _ in range(self.max_iterations):
            trial = x.copy()
            trial[:, self.free] += length[:, None] * step
            missing = gap(trial)
            follow = -_apply(inverse, missing)
            size, rest = np.max(np.abs(step), axis=1), np.max(np.abs(follow), axis=1)
            scale = 1.0 + np.max(np.abs(x), axis=1)
            # Light links on heavy chains: rounding ends the descent before the tolerance does.
            rounded = (rest > 0.5 * size) & (size <= _ROUNDING * scale)
            done = (rest <= self.tolerance * scale) | rounded
            if np.all(done & (length == 1.0)):
                self._inverse = inverse
                return self.wrapped(trial)
            if np.all(done | (rest < _CONTRACTION * size)):
                x, step, fresh = trial, follow, False
                length[:] = 1.0
            elif not fresh:
                inverse, fresh = self._invert(x, x1, x2, dt), True
                step = -_apply(inverse, gap(x))
            elif np.all(done | (rest < size)):
                x, inverse = trial, self._invert(trial, x1, x2, dt)
                step = -_apply(inverse, missing)
                length[:] = 1.0
            else:
                length = np.where(done | (rest < size), length, 0.5 * length)
                if np.min(length) < _SHORTEST:
                    break
        self._inverse = None
        raise SimulationError(
            f"Newton's method found no solution of a step of {dt:g} s ({self.setting.integrator}): "
            "take a smaller step, softer contact or more damping"
        )

    def wrapped(self, x: FloatArray) -> FloatArray:
        """Return `x` with rotation vectors at most π long: the same pose, a regular chart."""
        out = np.array(x, dtype=float)
        for where in self._balls:
            r = out[:, where]
            far = np.sum(r * r, axis=1) > np.pi**2
            if np.any(far):
                r[far] = Rotation.from_rotvec(r[far]).as_rotvec()
        return out


def _apply(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("bij,bj->bi", matrix, vector))
