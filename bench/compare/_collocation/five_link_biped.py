"""Kelly's five-link biped (section 7, appendix F) in absolute link angles, written for tests.

Every center of mass is a sum over links of lengths times unit vectors, G_k = sum_j a_kj e(q_j) with
e(q) = (-sin q, cos q), which makes mass matrix, centrifugal and gravity terms sums as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from trajopt import collocation as col

G = 9.81
MASS = [3.2, 6.8, 20.0, 6.8, 3.2]
INERTIA = [0.93, 1.08, 2.22, 1.08, 0.93]
TIBIA, FEMUR = 0.4, 0.4
D_TIBIA, D_FEMUR, D_TORSO = 0.128, 0.163, 0.2  # the torso's measured from the hip
CENTER = [
    [TIBIA - D_TIBIA, 0, 0, 0, 0],
    [TIBIA, FEMUR - D_FEMUR, 0, 0, 0],
    [TIBIA, FEMUR, D_TORSO, 0, 0],
    [TIBIA, FEMUR, 0, -D_FEMUR, 0],
    [TIBIA, FEMUR, 0, -FEMUR, -D_TIBIA],
]
JOINT = {  # P0, P1, P2, P4, P5
    0: [0, 0, 0, 0, 0],
    1: [TIBIA, 0, 0, 0, 0],
    2: [TIBIA, FEMUR, 0, 0, 0],
    4: [TIBIA, FEMUR, 0, -FEMUR, 0],
    5: [TIBIA, FEMUR, 0, -FEMUR, -TIBIA],
}
STEP_TIME, STEP_LENGTH = 0.7, 0.5


def coupling(i: int, j: int) -> float:
    return sum(m * a[i] * a[j] for m, a in zip(MASS, CENTER, strict=True))


def solve(a: list[list[Any]], b: list[Any]) -> list[Any]:
    """Gauss elimination of a positive definite system in plain arithmetic."""
    n = len(b)
    a, b = [list(row) for row in a], list(b)
    for k in range(n):
        for i in range(k + 1, n):
            factor = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - factor * a[k][j]
            b[i] = b[i] - factor * b[k]
    x: list[Any] = [0.0] * n
    for k in reversed(range(n)):
        x[k] = (b[k] - sum(a[k][j] * x[j] for j in range(k + 1, n))) / a[k][k]
    return x


def dynamics(_t: Any, x: Any, u: Any) -> list[Any]:
    """(F.3); torque u_i acts on link i and back on the link before."""
    q, v = [x[i] for i in range(5)], [x[5 + i] for i in range(5)]
    mass = [
        [coupling(i, j) * np.cos(q[i] - q[j]) + (INERTIA[i] if i == j else 0) for j in range(5)]
        for i in range(5)
    ]
    force = []
    for i in range(5):
        weight = G * sum(m * a[i] for m, a in zip(MASS, CENTER, strict=True))
        f = u[i] - (u[i + 1] if i < 4 else 0) + weight * np.sin(q[i])
        for j in range(5):
            if j != i and coupling(i, j) != 0:
                f = f - coupling(i, j) * np.sin(q[i] - q[j]) * v[j] ** 2
        force.append(f)
    return [*v, *solve(mass, force)]


def place(lengths: list[float], q: list[Any]) -> tuple[Any, Any]:
    used = [i for i in range(5) if lengths[i] != 0]
    return (
        sum((-lengths[i] * np.sin(q[i]) for i in used), 0.0),
        sum((lengths[i] * np.cos(q[i]) for i in used), 0.0),
    )


def velocity(lengths: list[float], q: list[Any], v: list[Any]) -> tuple[Any, Any]:
    used = [i for i in range(5) if lengths[i] != 0]
    return (
        sum((-lengths[i] * np.cos(q[i]) * v[i] for i in used), 0.0),
        sum((-lengths[i] * np.sin(q[i]) * v[i] for i in used), 0.0),
    )


def momentum(links: range, joint: int, q: list[Any], v: list[Any]) -> Any:
    """Angular momentum of some links about a joint."""
    px, py = place([float(a) for a in JOINT[joint]], q)
    total = 0.0
    for k in links:
        gx, gy = place(CENTER[k], q)
        wx, wy = velocity(CENTER[k], q, v)
        total = total + MASS[k] * ((gx - px) * wy - (gy - py) * wx) + INERTIA[k] * v[k]
    return total


def boundary(_t0: Any, _tf: Any, x0: Any, xf: Any) -> list[Any]:
    """Heel strike (F.9) to (F.15) as residuals, step length (7.3), foot velocities (7.4)."""
    q0, v0 = [x0[i] for i in range(5)], [x0[5 + i] for i in range(5)]
    qf, vf = [xf[i] for i in range(5)], [xf[5 + i] for i in range(5)]
    rows = [q0[i] - qf[4 - i] for i in range(5)]
    before = [(5, range(5)), (4, range(4)), (2, range(3)), (2, range(2)), (1, range(1))]
    after = [(0, range(5)), (1, range(1, 5)), (2, range(2, 5)), (2, range(3, 5)), (4, range(4, 5))]
    for (p, links), (r, others) in zip(before, after, strict=True):
        rows.append(momentum(links, p, qf, vf) - momentum(others, r, q0, v0))
    x, y = place(JOINT[5], qf)
    return [*rows, x - STEP_LENGTH, y, velocity(JOINT[5], q0, v0)[1], velocity(JOINT[5], qf, vf)[1]]


def biped() -> col.Problem:
    from trajopt import collocation as col  # the functions above serve other libraries too

    first = np.array([-0.3, 0.7, 0.0, -0.5, -0.6])
    last = first[::-1]
    rate = (last - first) / STEP_TIME
    return col.Problem(
        dynamics=dynamics,
        nx=10,
        nu=5,
        tf=STEP_TIME,
        objective=lambda _t, _x, u: sum(u[i] ** 2 for i in range(5)),
        boundary=(boundary, [0.0] * 12 + [0.0, -np.inf], [0.0] * 12 + [np.inf, 0.0]),
        u_bounds=([0.0, *[-100.0] * 4], [0.0, *[100.0] * 4]),
        guess={
            "t": np.array([0.0, STEP_TIME]),
            "x": np.array([[*first, *rate], [*last, *rate]]),
            "u": np.zeros((2, 5)),
        },
    )
