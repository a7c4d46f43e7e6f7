"""What touches the world, how deep, how fast and for how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.audit.motion import Motion, continuous
from trajopt.models import dynamics
from trajopt.norms import rms
from trajopt.world import World

__all__ = [
    "BREAK_SHARE",
    "LOADED_SHARE",
    "ContactState",
    "contact_state",
    "count_changes",
    "flights",
]

FloatArray = NDArray[np.float64]

# A point carries load above this share of the body weight, and a body counts as standing; it
# counts as lifted below the second share. Two thresholds, so that a load that trembles about one
# of them is not counted as many steps.
LOADED_SHARE = 0.05
BREAK_SHARE = 0.01

# Step of the central difference for velocities, as a share of the frame's: rounding 1e-10 m/s.
_DIFFERENCE = 1e-3


@dataclass(frozen=True)
class ContactState:
    """Contact points of a motion at its frames 0 to N.

    Parameters
    ----------
    times : (M,) array
        Times [s], M = N + 1.
    body : (P,) array of int
        Body that each point belongs to.
    depth : (M, P) array
        Penetration, at least 0 [m].
    normal_force : (M, P) array
        Force along the normal [N].
    tangent_force : (M, P) array
        Size of the friction force [N].
    slip : (M, P) array
        Speed along the surface [m/s].
    body_weight : float
        Weight of the character [N].
    """

    times: FloatArray
    body: NDArray[np.intp]
    depth: FloatArray
    normal_force: FloatArray
    tangent_force: FloatArray
    slip: FloatArray
    body_weight: float

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which points carry more than `LOADED_SHARE` of the body weight, (M, P)."""
        return np.asarray(self.normal_force > LOADED_SHARE * self.body_weight)

    @property
    def penetration_rms(self) -> float:
        """Root mean square of the depth over touching points [m]."""
        return rms(self.depth[self.depth > 0.0])

    @property
    def slip_rms(self) -> float:
        """Root mean square of the slip speed, weighted with depth² as the force is [m/s]."""
        weight = self.depth**2
        total = float(np.sum(weight))
        return float(np.sqrt(np.sum(weight * self.slip**2) / total)) if total > 0.0 else 0.0

    @property
    def slip_max(self) -> float:
        """Largest slip speed of a loaded point [m/s]."""
        return float(np.max(self.slip[self.loaded], initial=0.0))

    @property
    def cone_max(self) -> float:
        """Largest ratio of friction to normal force of a loaded point."""
        loaded = self.loaded
        ratio = self.tangent_force[loaded] / self.normal_force[loaded]
        return float(np.max(ratio, initial=0.0))

    def load(self) -> dict[int, FloatArray]:
        """Return the normal force (M,) on every body that has contact points [N]."""
        return {
            int(j): np.asarray(np.sum(self.normal_force[:, self.body == j], axis=1))
            for j in np.unique(self.body)
        }


def contact_state(motion: Motion) -> ContactState:
    """Evaluate the contact points of a motion with the velocities of its C² interpolant.

    Parameters
    ----------
    motion : Motion
        N frames, or a `Solution`.

    Returns
    -------
    ContactState
    """
    model, curve = motion.model, continuous(motion)
    times = curve.times[1:]
    h = _DIFFERENCE * float(np.min(np.diff(times)))
    x = curve(times)
    ahead, behind = (
        model.contact_positions(curve(times + h)),
        model.contact_positions(curve(times - h)),
    )
    velocity = (ahead - behind) / (2.0 * h)
    law = dynamics.physics(model, motion.world, motion.contact, "verlet")
    force = np.asarray(dynamics.core_model(model).contact_forces(x, velocity, law))
    normal, offset = _ground(motion)
    depth = model.point_radius + offset - model.contact_positions(x) @ normal
    return ContactState(
        times=times,
        body=np.asarray(model.point_body, dtype=np.intp),
        depth=np.maximum(depth, 0.0),
        normal_force=force @ normal,
        tangent_force=np.linalg.norm(_tangent(force, normal), axis=-1),
        slip=np.linalg.norm(_tangent(velocity, normal), axis=-1),
        body_weight=body_weight(motion),
    )


def count_changes(load: FloatArray, body_weight: float) -> tuple[int, int]:
    """Count how often a body takes up and loses its load.

    Parameters
    ----------
    load : (M,) array
        Normal force on the body [N].
    body_weight : float
        Weight of the character [N].

    Returns
    -------
    makes, breaks : int
        Crossings above `LOADED_SHARE` and below `BREAK_SHARE` of the weight, in turn.

    Examples
    --------
    >>> count_changes(np.array([0.0, 0.5, 0.03, 0.5, 0.0, 0.5]), 1.0)
    (2, 1)
    """
    makes = breaks = 0
    standing = bool(load[0] > LOADED_SHARE * body_weight)
    for value in load[1:]:
        if not standing and value > LOADED_SHARE * body_weight:
            standing, makes = True, makes + 1
        elif standing and value < BREAK_SHARE * body_weight:
            standing, breaks = False, breaks + 1
    return makes, breaks


def flights(state: ContactState) -> list[tuple[float, float]]:
    """Return begin and end of every time without support [s].

    Frames with less than `BREAK_SHARE` of the weight on all points together, at least two in a row.
    """
    free = np.sum(state.normal_force, axis=1) < BREAK_SHARE * state.body_weight
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(int)))
    return [
        (float(state.times[a]), float(state.times[b - 1]))
        for a, b in edges.reshape(-1, 2)
        if b - a >= 2
    ]


def body_weight(motion: Motion) -> float:
    """Weight of the character in the gravity of its world [N]; of 9.81 m/s² where there is none."""
    gravity = 9.81 if motion.world is None else float(np.linalg.norm(motion.world.gravity))
    return float(motion.model.mass) * (gravity or 9.81)


def _ground(motion: Motion) -> tuple[FloatArray, float]:
    """Normal and offset of the plane; one infinitely far below where there is no ground."""
    world = motion.world
    if world is None:
        world = World() if motion.contact is not None else World([])
    if not world.obstacles:
        return np.array([0.0, 0.0, 1.0]), -np.inf
    plane = world.obstacles[0]
    return np.array(plane.normal), float(plane.offset)


def _tangent(vector: FloatArray, normal: FloatArray) -> FloatArray:
    return np.asarray(vector - (vector @ normal)[..., None] * normal)
