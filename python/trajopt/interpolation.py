"""C² motion through the frames of a trajectory: what the discrete solution means in between."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from trajopt.errors import ArgumentError
from trajopt.kinematics import ball_slices

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Interpolant"]

FloatArray = NDArray[np.float64]


class Interpolant:
    """Twice continuously differentiable motion through given frames.

    Slides and hinges follow a cubic spline. Rotations follow the spline of their unit quaternions,
    taken with continuous signs and normalized: it is C² and of fourth order like its components,
    has no chart that wraps and passes through any number of turns, as long as two neighbouring
    frames are less than half a turn apart.

    Parameters
    ----------
    model : Model
        Character with D degrees of freedom.
    times : (M,) array_like
        Strictly increasing times [s], M ≥ 2; the steps need not be equal.
    x : (M, D) array_like
        Coordinates at these times [m, rad].

    Notes
    -----
    A C² cubic spline that satisfies the equations of motion at its knots is the
    ``linear_acceleration`` scheme: for smooth motion the two agree to second order in dt and
    the interpolant adds no error of its own.

    Examples
    --------
    >>> import numpy as np, trajopt
    >>> chain = trajopt.load_model("chain")
    >>> x = np.tile(chain.home, (5, 1))
    >>> x[:, 0] = np.arange(5.0) ** 2
    >>> motion = Interpolant(chain, np.arange(5.0), x)
    >>> float(motion(1.5)[0].round(9)), float(motion.velocity(1.5)[0].round(9))
    (2.25, 3.0)
    """

    def __init__(self, model: Model, times: ArrayLike, x: ArrayLike) -> None:
        self.model = model
        self.times = np.asarray(times, dtype=float)
        frames = np.asarray(x, dtype=float)
        if self.times.ndim != 1 or len(self.times) < 2 or np.any(np.diff(self.times) <= 0.0):
            raise ArgumentError("times must be a strictly increasing vector of at least two values")
        if frames.shape != (len(self.times), model.ndof):
            raise ArgumentError(
                f"x must have shape {(len(self.times), model.ndof)} to match times and model, "
                f"got {frames.shape}"
            )
        self._balls = ball_slices(model)
        quaternions = [_continuous_quaternions(frames[:, where]) for where in self._balls]
        self._spline = CubicSpline(self.times, np.concatenate([frames, *quaternions], axis=1))

    def __call__(self, t: ArrayLike) -> FloatArray:
        """Return the coordinates at `t`.

        Parameters
        ----------
        t : (...) array_like
            Times [s]; outside of the frames the end polynomials continue.

        Returns
        -------
        (..., D) array
            Coordinates [m, rad]; rotation vectors are at most π long.
        """
        t = np.asarray(t, dtype=float)
        out, quaternions = self._at(t, 0)
        for where, q in zip(self._balls, quaternions, strict=True):
            out[..., where] = Rotation.from_quat(q.reshape(-1, 4)).as_rotvec().reshape(*t.shape, 3)
        return out

    def velocity(self, t: ArrayLike) -> FloatArray:
        """Return the tangent velocity at `t`.

        Parameters
        ----------
        t : (...) array_like
            Times [s].

        Returns
        -------
        (..., D) array
            Rates [m/s, rad/s]. A ball joint's entries are its angular velocity ω in the axes of
            the frame before the joint (world axes for a free base): Ṙ = [ω]× R.
        """
        t = np.asarray(t, dtype=float)
        out, rates = self._at(t, 1)
        for where, q, rate in zip(self._balls, self._at(t, 0)[1], rates, strict=True):
            out[..., where] = _angular_velocity(q, rate)
        return out

    def _at(self, t: FloatArray, derivative: int) -> tuple[FloatArray, list[FloatArray]]:
        """Return the splines of the coordinates, and of each ball joint's quaternion."""
        values, ndof = self._spline(t, derivative), self.model.ndof
        quaternions = [
            values[..., ndof + 4 * k : ndof + 4 * (k + 1)] for k in range(len(self._balls))
        ]
        return np.array(values[..., :ndof]), quaternions


def _continuous_quaternions(rotation_vectors: FloatArray) -> FloatArray:
    """Unit quaternions (M, 4), scalar last, each in the hemisphere of the one before it."""
    q = Rotation.from_rotvec(rotation_vectors).as_quat()
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    q[1:] *= np.cumprod(flips)[:, None]
    return np.asarray(q)


def _angular_velocity(q: FloatArray, rate: FloatArray) -> FloatArray:
    """ω = 2 vec(q̇ q*) / |q|², the part of q̇ along q drops out by itself."""
    v, w = q[..., :3], q[..., 3:]
    dv, dw = rate[..., :3], rate[..., 3:]
    turn = w * dv - dw * v - np.cross(dv, v)
    return np.asarray(2.0 * turn / np.sum(q * q, axis=-1, keepdims=True))
