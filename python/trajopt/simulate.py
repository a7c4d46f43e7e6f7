"""Forward simulation with the residual that the optimizer makes zero."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.errors import ArgumentError
from trajopt.stepping import Setting, SimulationError, Stepper

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.world import Contact, World

__all__ = ["Simulation", "SimulationError", "simulate"]

FloatArray = NDArray[np.float64]
Control = Callable[[float, FloatArray, FloatArray], ArrayLike]

# Step [s] of the little parabola that yields the first acceleration: its error of order h² and the
# rounding error of order 1e-16 / h² are both about 1e-8.
_PROBE = 1e-4


@dataclass(frozen=True)
class Simulation:
    """Frames of a simulated motion.

    Parameters
    ----------
    times : (S+1,) array
        Times of the frames [s], from 0.
    x : (..., S+1, D) array
        Coordinates [m, rad], with the leading axes of the start.
    before : (..., D) array
        The frame before the first one, at time -dt / substeps: with it the first frame has its
        velocity and acceleration.
    """

    times: FloatArray
    x: FloatArray
    before: FloatArray


def simulate(
    model: Model,
    x0: ArrayLike,
    v0: ArrayLike,
    duration: float,
    dt: float,
    *,
    integrator: str = "linear_acceleration",
    world: World | None = None,
    contact: Contact | None = None,
    control: ArrayLike | Control | None = None,
    substeps: int = 1,
) -> Simulation:
    """Let a character move under gravity, contact and given joint forces.

    Parameters
    ----------
    model : Model
        Character with D degrees of freedom, nu of them actuated.
    x0 : (..., D) array_like
        Start [m, rad]; leading axes are motions that are simulated side by side.
    v0 : (..., D) array_like
        Tangent velocity at the start [m/s, rad/s], the convention of `Model.integrate`.
    duration : float
        Time to simulate [s]; rounded to whole steps.
    dt : float
        Time between the frames returned [s].
    integrator : str, optional
        ``"implicit"``, ``"verlet"``, ``"fox_goodwin"``, ``"linear_acceleration"`` or
        ``"trapezoidal"``.
    world, contact : World, Contact, optional
        What the character touches and how, as in `Model.dynamics_residual`.
    control : array_like or callable, optional
        Forces of the actuated degrees of freedom [N, N·m]: nothing (zero), a constant (nu,), a
        table (S·substeps, nu), or a function ``control(t, x, v)`` of the time, frame and backward
        velocity before each step that returns (..., nu).
    substeps : int, optional
        Steps of the simulation between two frames returned.

    Returns
    -------
    Simulation

    Raises
    ------
    ArgumentError
        If `dt` or `duration` is not positive, `substeps` is below 1 or a shape does not fit.
    SimulationError
        If a step has no solution.

    Notes
    -----
    Every step solves FD(x_i, x_{i-1}, x_{i-2}) = Bᵀu for x_i. The start is consistent to second
    order: x_{-1} = x_0 − dt v_0 + dt² a_0 / 2, with a_0 from the equations of motion.

    Examples
    --------
    A metre of free fall takes sqrt(2 / 9.81) = 0.4515 s:

    >>> import numpy as np, trajopt
    >>> chain = trajopt.load_model("chain")
    >>> fall = simulate(chain, chain.home, np.zeros(chain.ndof), 0.4515, 0.04515)
    >>> float((fall.x[-1, 2] - chain.home[2]).round(2))
    -1.0
    """
    if not (np.isfinite(dt) and dt > 0.0 and np.isfinite(duration) and duration > 0.0):
        raise ArgumentError(f"dt and duration must be positive, got {dt} and {duration}")
    if substeps < 1:
        raise ArgumentError(f"substeps must be at least 1, got {substeps}")
    x0, v0 = np.broadcast_arrays(np.asarray(x0, float), np.asarray(v0, float))
    if x0.shape[-1:] != (model.ndof,):
        raise ArgumentError(f"x0 and v0 must have {model.ndof} entries a motion, got {x0.shape}")
    shape = x0.shape
    start, speed = x0.reshape(-1, model.ndof), v0.reshape(-1, model.ndof)
    frames = max(1, round(duration / dt))
    step = dt / substeps
    drive = _Drive(model, control, frames * substeps, shape)

    stepper = Stepper(model, Setting(world, contact, integrator))
    acceleration = _start_acceleration(stepper, start, speed, drive(0, 0.0, start, speed))
    older = model.integrate(start, -step * speed + 0.5 * step**2 * acceleration)
    newer = stepper.wrapped(start)
    before, kept = older, [newer]
    for k in range(frames * substeps):
        velocity = model.difference(older, newer) / step
        force = drive(k, k * step, newer, velocity)
        guess = model.integrate(newer, velocity * step)
        older, newer = newer, stepper.advance(guess, newer, older, step, force)
        if (k + 1) % substeps == 0:
            kept.append(newer)
    return Simulation(
        times=np.asarray(dt * np.arange(frames + 1), dtype=np.float64),
        x=np.stack(kept, axis=1).reshape(*shape[:-1], frames + 1, model.ndof),
        before=before.reshape(shape),
    )


class _Drive:
    """Generalized force (B, D) of the actuated rows, whatever `control` was given as."""

    def __init__(
        self,
        model: Model,
        control: ArrayLike | Control | None,
        steps: int,
        shape: tuple[int, ...],
    ) -> None:
        self.rows = np.flatnonzero(model.actuated)
        self.ndof, self.shape = model.ndof, shape
        self.function = control if callable(control) else None
        self.table = np.zeros((1, len(self.rows)))
        if control is not None and not callable(control):
            self.table = np.atleast_2d(np.asarray(control, float))
            if self.table.shape not in ((1, len(self.rows)), (steps, len(self.rows))):
                raise ArgumentError(
                    f"control must have shape ({len(self.rows)},) or ({steps}, {len(self.rows)}), "
                    f"got {self.table.shape}"
                )

    def __call__(self, k: int, t: float, x: FloatArray, v: FloatArray) -> FloatArray:
        force = np.zeros((len(x), self.ndof))
        if self.function is None:
            force[:, self.rows] = self.table[k % len(self.table)]
        else:
            value = np.asarray(self.function(t, x.reshape(self.shape), v.reshape(self.shape)))
            force[:, self.rows] = np.broadcast_to(
                value, (*self.shape[:-1], len(self.rows))
            ).reshape(len(x), -1)
        return force


def _start_acceleration(
    stepper: Stepper, x: FloatArray, v: FloatArray, force: FloatArray
) -> FloatArray:
    """Tangent acceleration (B, D) by one explicit step of `_PROBE`: x₊ = x + h v + h² a."""
    setting = Setting(stepper.setting.world, stepper.setting.contact, "verlet")
    probe = Stepper(stepper.model, setting)
    ahead = stepper.model.integrate(x, _PROBE * v)
    behind = stepper.model.integrate(x, -_PROBE * v)
    landed = probe.advance(ahead, x, behind, _PROBE, force)
    return np.asarray((stepper.model.difference(x, landed) - _PROBE * v) / _PROBE**2)
