"""Check a model's dynamics against independent answers: finite differences and MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.models.coordinates import to_qpos, velocity_map

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Verification", "verify"]

FloatArray = NDArray[np.float64]

# What central differences can confirm of a Jacobian, and what is left of the O(dt²) error of the
# discrete dynamics at the smaller of the two steps.
DERIVATIVE_TOLERANCE = 1e-5
DYNAMICS_TOLERANCE = 1e-4
STEP = 2e-3


@dataclass(frozen=True)
class Verification:
    """How well a model's dynamics agree with independent answers.

    Parameters
    ----------
    flight, contact : float
        Largest relative difference of the Jacobians from central differences, over random states
        in the air and in the ground.
    inverse : float
        Largest relative difference of the residual at a small step from MuJoCo's inverse dynamics.
    order : float
        Order in the time step with which that difference falls; 2 is right.
    """

    flight: float
    contact: float
    inverse: float
    order: float

    @property
    def good(self) -> bool:
        """Whether all differences are within what the checks can tell."""
        derivatives = max(self.flight, self.contact)
        return derivatives < DERIVATIVE_TOLERANCE and self.inverse < DYNAMICS_TOLERANCE


def verify(model: Model, samples: int = 4, seed: int = 0) -> Verification:
    """Check derivatives and dynamics of `model` at random states.

    Parameters
    ----------
    model : Model
        Character with D degrees of freedom.
    samples : int, optional
        Random states of each kind.
    seed : int, optional
        Seed of the random states.

    Returns
    -------
    Verification

    Examples
    --------
    >>> import trajopt
    >>> verify(trajopt.load_model("chain")).good
    True
    """
    rng = np.random.default_rng(seed)
    errors = [_inverse_error(model, rng) for _ in range(samples)]
    coarse, fine = np.max(errors, axis=0)
    return Verification(
        flight=max(_derivative_error(model, rng, touching=False) for _ in range(samples)),
        contact=max(_derivative_error(model, rng, touching=True) for _ in range(samples)),
        inverse=float(fine),
        order=float(np.log2(coarse / fine)) if fine > 0 else 2.0,
    )


def _state(model: Model, rng: np.random.Generator) -> FloatArray:
    """Return a pose near home, within joint limits."""
    x = model.home + 0.1 * rng.normal(size=model.ndof)
    margin = 0.05 * np.nan_to_num(model.upper - model.lower, posinf=0.0)
    return np.clip(x, model.lower + margin, model.upper - margin)


def _derivative_error(model: Model, rng: np.random.Generator, *, touching: bool) -> float:
    from trajopt.world import Contact, World

    dt = 0.02
    x = _state(model, rng)
    if touching and np.isfinite(model.lowest_point(x)) and not model.actuated[2]:
        x[2] -= float(model.lowest_point(x)) + 0.01 * model.length
    velocity = rng.normal(size=model.ndof)
    bend = dt**2 * rng.normal(size=model.ndof)
    frames = np.array([x, x - dt * velocity, x - 2 * dt * velocity + bend])
    surroundings: dict[str, Any] = {"world": World([])}
    if touching:
        surroundings = {"world": World(), "contact": Contact()}

    def residual(nodes: FloatArray) -> FloatArray:
        return model.dynamics_residual(nodes[0], nodes[1], nodes[2], dt, **surroundings)

    exact = model.dynamics_jacobians(frames[0], frames[1], frames[2], dt, **surroundings)
    worst, step = 0.0, 1e-6
    for node, jacobian in enumerate(exact):
        moved = np.zeros((3, model.ndof, model.ndof))  # one row a coordinate that is moved
        moved[node] = step * np.eye(model.ndof)
        at = frames[:, None, :]
        estimate = (residual(at + moved) - residual(at - moved)).T / (2 * step)
        scale = float(np.abs(jacobian).max(initial=1e-12))
        worst = max(worst, float(np.abs(estimate - jacobian).max()) / scale)
    return worst


def _inverse_error(model: Model, rng: np.random.Generator) -> tuple[float, float]:
    """Return the relative difference from MuJoCo's inverse dynamics at two time steps."""
    from trajopt.world import World

    x = _state(model, rng)
    velocity, acceleration = rng.normal(size=(2, model.ndof))
    expected = _mujoco_inverse(model, x, velocity, acceleration)
    errors = []
    for dt in (2 * STEP, STEP):
        after, before = (x + s * dt * velocity + dt**2 / 2 * acceleration for s in (1, -1))
        found = model.dynamics_residual(after, x, before, dt, world=World([]))
        errors.append(float(np.abs(found - expected).max() / np.abs(expected).max()))
    return errors[0], errors[1]


def _mujoco_inverse(
    model: Model, x: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return M ẍ + c(x, ẋ) + g(x) in the coordinates of `model`, without passive forces."""
    import mujoco

    m = mujoco.MjModel.from_xml_string(model.xml)
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    m.opt.gravity[:] = (0.0, 0.0, -9.81)
    m.opt.density = m.opt.viscosity = 0.0
    m.dof_damping[:] = 0.0
    m.dof_armature[:] = 0.0
    m.jnt_stiffness[:] = 0.0
    data = mujoco.MjData(m)
    step = 1e-5
    here = velocity_map(m, x)
    drift = velocity_map(m, x + step * velocity) - velocity_map(m, x - step * velocity)
    data.qpos[:] = to_qpos(m, x)
    data.qvel[:] = here @ velocity
    data.qacc[:] = here @ acceleration + drift @ velocity / (2 * step)
    mujoco.mj_inverse(m, data)
    return np.asarray(here.T @ data.qfrc_inverse)
