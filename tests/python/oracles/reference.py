"""Discrete dynamics by brute force: point masses, product rule, complex step.

Every link is a cloud of point masses with exactly its pseudo-inertia. A point's position P(x) is a
product of 4x4 matrices, its derivative the product rule written out, and the generalized force is
the sum over points of (dP/dx)^T (m a - f): the paper's equation 5 before anybody has integrated or
simplified it. Twists, composite inertias and adjoint sweeps, which the core is made of, do not
appear. All functions are analytic in the coordinates, so a complex step differentiates them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64] | NDArray[np.complex128]

SLIDE, HINGE, BALL = 0, 1, 2
BETA = {"verlet": 0.0, "fox_goodwin": 1 / 12, "linear_acceleration": 1 / 6, "trapezoidal": 1 / 4}


@dataclass(frozen=True)
class Law:
    """World and force constants, SI: the reference's own copy of what the core calls physics."""

    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    ground: bool = True
    plane_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    plane_offset: float = 0.0
    normal: float = 3e3
    friction: float = 3e3
    damping: float = 0.0
    coulomb: bool = False
    mu: float = 0.8
    slip_velocity: float = 0.05
    limit: float = 10.0
    self_collision: float = 1e3
    integrator: str = "linear_acceleration"


@dataclass(frozen=True)
class Frame:
    """Positions (..., Q, 3) of mass, contact and sphere points and their (..., Q, D, 3) slopes."""

    x: Array
    mass: Array
    mass_slope: Array
    contact: Array
    contact_slope: Array
    sphere: Array
    sphere_slope: Array


def point_masses(moment: Array, count: int = 6, seed: int = 0) -> tuple[Array, Array]:
    """Masses (q,) and places (q, 3) whose 4x4 pseudo-inertia is `moment`.

    Six points on the principal axes (`count=6`) or a random cloud, moved by the affine map that
    gives it the right mean and covariance.
    """
    m = moment[3, 3]
    centre = moment[:3, 3] / m
    spread = moment[:3, :3] / m - np.outer(centre, centre)
    value, axes = np.linalg.eigh(spread)
    root = axes * np.sqrt(np.maximum(value, 0.0))
    if count == 6:
        unit = np.sqrt(3.0) * np.concatenate([np.eye(3), -np.eye(3)])
    else:
        cloud = np.random.default_rng(seed).normal(size=(count, 3))
        cloud -= cloud.mean(axis=0)
        unit = np.linalg.solve(np.linalg.cholesky(cloud.T @ cloud / count), cloud.T).T
    return np.full(count, m / count), centre + unit @ root.T


def _series(t: Array, first: int) -> Array:
    """Sum over k of (-t)^k / (2k + first)!: sin(s)/s for first = 1, (1 - cos s)/s^2 for 2."""
    total = np.zeros_like(t)
    term = np.ones_like(t) / (1.0 if first == 1 else 2.0)
    for k in range(30):
        total = total + term
        term = -term * t / ((2 * k + first + 1) * (2 * k + first + 2))
    return total


def _series_slope(t: Array, first: int) -> Array:
    """Derivative of `_series` with respect to t, term by term."""
    total = np.zeros_like(t)
    term = -np.ones_like(t) / (6.0 if first == 1 else 24.0)
    for k in range(30):
        total = total + (k + 1) * term
        term = -term * t / ((2 * k + first + 3) * (2 * k + first + 4))
    return total


def cross_matrix(r: Array) -> Array:
    out = np.zeros((*r.shape[:-1], 3, 3), dtype=r.dtype)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -r[..., 2], r[..., 1], -r[..., 0]
    return out - np.swapaxes(out, -1, -2)


def exponential(r: Array) -> tuple[Array, Array]:
    """Rotation exp([r]x) (..., 3, 3) and its slopes (..., 3, 3, 3), the axis before the matrix.

    The power series in t = r.r serve complex r and all |r| below 2 pi.
    """
    t = np.sum(r * r, axis=-1)[..., None, None]
    skew = cross_matrix(r)
    square = skew @ skew
    a, b, da, db = _series(t, 1), _series(t, 2), _series_slope(t, 1), _series_slope(t, 2)
    rotation = np.eye(3) + a * skew + b * square
    slopes = []
    for k in range(3):
        unit = cross_matrix(np.eye(3)[k])
        dt = 2.0 * r[..., k, None, None]
        slopes.append(
            da * dt * skew + a * unit + db * dt * square + b * (unit @ skew + skew @ unit)
        )
    return rotation, np.stack(slopes, axis=-3)


class Reference:
    """The tree of `Model.core_arguments()` as points that move.

    Parameters
    ----------
    arguments : dict
        Joint tree arrays under the names the core takes.
    count : int, optional
        Mass points per link.
    """

    def __init__(self, arguments: dict[str, Array], count: int = 6) -> None:
        self.kind = [int(k) for k in arguments["joint_type"]]
        self.parent = [int(p) for p in arguments["joint_parent"]]
        self.offset = np.asarray(arguments["joint_offset"], float)
        self.axis = np.asarray(arguments["joint_axis"], float)
        self.lower = np.asarray(arguments["lower"], float)
        self.upper = np.asarray(arguments["upper"], float)
        self.start = np.concatenate([[0], np.cumsum([3 if k == BALL else 1 for k in self.kind])])
        self.ndof = int(self.start[-1])
        self.contact_joint = np.asarray(arguments["point_joint"], int)
        self.contact_place = np.asarray(arguments["point_position"], float).reshape(-1, 3)
        self.contact_radius = np.asarray(arguments["point_radius"], float)
        self.sphere_joint = np.asarray(arguments["sphere_joint"], int)
        self.sphere_place = np.asarray(arguments["sphere_position"], float).reshape(-1, 3)
        self.sphere_radius = np.asarray(arguments["sphere_radius"], float)
        self.pairs = np.asarray(arguments["sphere_pairs"], int).reshape(-1, 2)
        joints, masses, places = [], [], []
        for j, moment in enumerate(np.asarray(arguments["link_inertia"], float)):
            if moment[3, 3] > 0.0:
                m, p = point_masses(moment, count, seed=j)
                joints.append(np.full(len(m), j))
                masses.append(m)
                places.append(p)
        self.mass_joint = np.concatenate(joints)
        self.mass = np.concatenate(masses)
        self.mass_place = np.concatenate(places)

    def transforms(self, x: Array) -> tuple[Array, Array]:
        """World transforms (..., J, 4, 4) and their slopes (..., J, D, 4, 4)."""
        shape, dtype = x.shape[:-1], x.dtype
        world: list[Array] = []
        slope: list[Array] = []
        for j, kind in enumerate(self.kind):
            here = np.zeros((4, 4))
            here[:3], here[3, 3] = self.offset[j], 1.0
            if self.parent[j] < 0:
                base = np.broadcast_to(here, (*shape, 4, 4)).astype(dtype)
                base_slope = np.zeros((*shape, self.ndof, 4, 4), dtype=dtype)
            else:
                base = world[self.parent[j]] @ here
                base_slope = slope[self.parent[j]] @ here
            motion = np.broadcast_to(np.eye(4), (*shape, 4, 4)).astype(dtype)
            s, e = self.start[j], self.start[j + 1]
            motion_slope = np.zeros((*shape, e - s, 4, 4), dtype=dtype)
            if kind == SLIDE:
                motion[..., :3, 3] = x[..., s, None] * self.axis[j]
                motion_slope[..., 0, :3, 3] = self.axis[j]
            elif kind == HINGE:
                turn = cross_matrix(self.axis[j])
                sine, cosine = (f(x[..., s, None, None]) for f in (np.sin, np.cos))
                motion[..., :3, :3] += sine * turn + (1.0 - cosine) * (turn @ turn)
                motion_slope[..., 0, :3, :3] = cosine * turn + sine * (turn @ turn)
            else:
                motion[..., :3, :3], motion_slope[..., :3, :3] = exponential(x[..., s:e])
            here_slope = base_slope @ motion[..., None, :, :]
            here_slope[..., s:e, :, :] += base[..., None, :, :] @ motion_slope
            world.append(base @ motion)
            slope.append(here_slope)
        return np.stack(world, axis=-3), np.stack(slope, axis=-4)

    def frame(self, x: Array) -> Frame:
        """All points of one frame; leading axes of `x` are kept."""
        world, slope = self.transforms(np.asarray(x))

        def points(joint: Array, place: Array) -> tuple[Array, Array]:
            homogeneous = np.concatenate([place, np.ones((len(place), 1))], axis=1)
            position = np.einsum("...qab,qb->...qa", world[..., joint, :3, :], homogeneous)
            gradient = np.einsum("...qdab,qb->...qda", slope[..., joint, :, :3, :], homogeneous)
            return position, gradient

        return Frame(
            np.asarray(x),
            *points(self.mass_joint, self.mass_place),
            *points(self.contact_joint, self.contact_place),
            *points(self.sphere_joint, self.sphere_place),
        )

    def contact_force(self, p: Array, v: Array, law: Law) -> Array:
        """Force (..., P, 3) on sphere centres `p` that move with velocity `v`."""
        n = np.asarray(law.plane_normal)
        gap = self.contact_radius - (p @ n - law.plane_offset)
        depth = np.where(gap.real > 0.0, gap, 0.0)
        v_n = v @ n
        v_t = v - v_n[..., None] * n
        push = law.normal * depth**2 * softplus(1.0 - law.damping * v_n)
        if law.coulomb:
            slow = np.sqrt(np.sum(v_t * v_t, axis=-1) + law.slip_velocity**2)
            drag = -law.mu * (push / slow)[..., None] * v_t
        else:
            drag = -law.friction * depth[..., None] ** 2 * v_t
        return push[..., None] * n + drag

    def internal(self, f: Frame, law: Law) -> Array:
        """Gradient (..., D) of the limit and self-collision energies."""
        above, below = f.x - self.upper, self.lower - f.x
        above = np.where(above.real > 0.0, above, 0.0)
        below = np.where(below.real > 0.0, below, 0.0)
        out = 3.0 * law.limit * (above**2 - below**2)
        a, b = self.pairs.T
        apart = f.sphere[..., a, :] - f.sphere[..., b, :]
        distance = np.sqrt(np.sum(apart * apart, axis=-1))
        overlap = self.sphere_radius[a] + self.sphere_radius[b] - distance
        for k in np.flatnonzero(np.any(overlap.real.reshape(-1, len(a)) > 0.0, axis=0)):
            depth = np.where(overlap[..., k].real > 0.0, overlap[..., k], 0.0)
            force = (-3.0 * law.self_collision * depth**2 / distance[..., k])[..., None]
            gradient = f.sphere_slope[..., a[k], :, :] - f.sphere_slope[..., b[k], :, :]
            out = out + np.einsum("...dc,...c->...d", gradient, force * apart[..., k, :])
        return out

    def inertia(
        self, f0: Frame, f1: Frame, f2: Frame, steps: tuple[float, float], law: Law
    ) -> Array:
        """Sum over mass points of m (dP/dx)^T (a + g e_z), tested at the scheme's frame."""
        plus, minus = steps
        acceleration = (f0.mass - f1.mass) / plus - (f1.mass - f2.mass) / minus
        acceleration = acceleration * (2.0 / (plus + minus))
        up = acceleration - np.asarray(law.gravity)
        test = f0 if law.integrator == "implicit" else f1
        return np.einsum("...qdc,...qc->...d", test.mass_slope, self.mass[:, None] * up)

    def contact(
        self, f0: Frame, f1: Frame, f2: Frame, steps: tuple[float, float], law: Law
    ) -> Array:
        """Generalized contact force (..., D), to be subtracted."""
        plus, minus = steps
        forward = (f0.contact - f1.contact) / plus
        backward = (f1.contact - f2.contact) / minus

        def work(f: Frame, velocity: Array) -> Array:
            force = self.contact_force(f.contact, velocity, law)
            return np.einsum("...qdc,...qc->...d", f.contact_slope, force)

        if law.integrator == "implicit":
            return work(f0, forward)
        beta = BETA[law.integrator]
        theta = friction_weight(law, (plus + minus) / 2.0)
        late = max(0.0, 2.0 * theta - 1.0)
        share = 2.0 * beta / (plus + minus)
        total = (1.0 - 2.0 * beta) * work(f1, theta * forward + (1.0 - theta) * backward)
        if beta > 0.0:
            total = total + share * plus * work(f0, forward)
            total = total + share * minus * work(f2, late * forward + (1.0 - late) * backward)
        return total

    def mechanics(
        self, f0: Frame, f1: Frame, f2: Frame, steps: tuple[float, float], law: Law
    ) -> Array:
        """Everything but contact."""
        test = f0 if law.integrator == "implicit" else f1
        return self.inertia(f0, f1, f2, steps, law) + self.internal(test, law)

    def residual(self, x: Array, x1: Array, x2: Array, dt: Step, law: Law) -> Array:
        """Residual (..., D) [N, N m] of frames i, i-1, i-2."""
        frames, steps = (self.frame(x), self.frame(x1), self.frame(x2)), pair(dt)
        out = self.mechanics(*frames, steps, law)
        return out - self.contact(*frames, steps, law) if law.ground else out

    def jacobians(
        self, x: Array, x1: Array, x2: Array, dt: Step, laws: list[Law]
    ) -> list[tuple[Array, Array, Array]]:
        """Complex-step derivatives (..., D, D) for each law; the frames are computed once."""
        nodes = [self.frame(np.asarray(q)[..., None, :]) for q in (x, x1, x2)]
        nudge = 1e-30j * np.eye(self.ndof)
        steps, laws_out, known = pair(dt), [], {}
        nudged = [self.frame(np.asarray(q)[..., None, :] + nudge) for q in (x, x1, x2)]
        triples = [[nudged[m] if m == k else nodes[m] for m in range(3)] for k in range(3)]
        for law in laws:
            # Contact laws share all but contact, by far the larger part of the work.
            key = (law.integrator == "implicit", law.gravity, law.limit, law.self_collision)
            if key not in known:
                known[key] = [self.mechanics(*frames, steps, law) for frames in triples]
            blocks = []
            for frames, mechanics in zip(triples, known[key], strict=True):
                total = mechanics - self.contact(*frames, steps, law) if law.ground else mechanics
                blocks.append(np.swapaxes(total.imag / 1e-30, -1, -2))
            laws_out.append((blocks[0], blocks[1], blocks[2]))
        return laws_out


Step = float | tuple[float, float]


def pair(dt: Step) -> tuple[float, float]:
    return dt if isinstance(dt, tuple) else (dt, dt)


def softplus(y: Array, e: float = 0.5) -> Array:
    """C1 version of max(y, 0): y above e, 0 below -e, a parabola between."""
    return np.where(y.real >= e, y, np.where(y.real <= -e, 0.0, (y + e) ** 2 / (4.0 * e)))


def friction_weight(law: Law, dt: float) -> float:
    """Share theta of the newer velocity: the least for which a sliding point keeps z >= -1/2.

    z = (1 - 2 (1 - theta) a) / (1 + 2 theta a), a = rate / 2, is the factor per frame of its slip.
    """
    if law.normal <= 0.0:
        return 0.5
    drag = law.mu / law.slip_velocity if law.coulomb else law.friction / law.normal
    rate = float(np.linalg.norm(law.gravity)) * drag * dt
    if rate <= 0.0:
        return 0.5
    # z grows with theta: z = -1/2 is 1 - rate + theta rate = -(1 + theta rate) / 2.
    return max(0.5, (rate - 1.5) / (1.5 * rate))
