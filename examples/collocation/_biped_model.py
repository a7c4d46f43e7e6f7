"""The five-link biped of Kelly's section 7 and appendix F, with the parameters of table 4.

The five links hang together by their absolute angles q, and every center of mass is a fixed
combination of unit vectors, G_i = Σ_j A_ij e(q_j) with e(q) = (−sin q, cos q). So the equations of
motion in these angles are short:

    Σ_k C_jk cos(q_j − q_k) q̈_k + I_j q̈_j + Σ_k C_jk sin(q_j − q_k) q̇_k² − g b_j sin q_j
        = u_j − u_{j+1},        C = Aᵀ m A,  b_j = Σ_i m_i A_ij

with u_j the torque on link j at the joint that it hangs on. They are the same as (F.4) to (F.8)
(where F.4 has a misprint, q̇ for q̈, and the right sum of F.7 starts at 4).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt import collocation as col

MASS = np.array([3.2, 6.8, 20.0, 6.8, 3.2])
INERTIA = np.array([0.93, 1.08, 2.22, 1.08, 0.93])
LENGTH = np.array([0.4, 0.4, 0.625, 0.4, 0.4])
# From the center of mass to the knee, the hip, (hip or shoulder), the hip, the knee.
CENTER = np.array([0.128, 0.163, 0.2, 0.163, 0.128])
GRAVITY = 9.81
STEP, DURATION = 0.5, 0.7


class Biped:
    """Dynamics, heel strike and points of the biped; all functions work traced and on numbers.

    Parameters
    ----------
    torso_from : str
        What the 0.2 m of table 4 are measured from: ``hip``, as the table says, or ``shoulder``,
        as the code does that came with the paper. The optimal gaits differ.
    """

    def __init__(self, torso_from: str = "hip") -> None:
        l1, l2, l3, l4, _ = LENGTH
        d1, d2, d3, d4, d5 = CENTER
        torso = {"hip": d3, "shoulder": l3 - d3}[torso_from]
        self.arms = np.array(
            [
                [l1 - d1, 0, 0, 0, 0],
                [l1, l2 - d2, 0, 0, 0],
                [l1, l2, torso, 0, 0],
                [l1, l2, 0, -d4, 0],
                [l1, l2, 0, -l4, -d5],
            ]
        )
        self.coupling = self.arms.T @ (MASS[:, None] * self.arms)
        self.weights = MASS @ self.arms
        # Heel strike: link n after it was link 6 - n before.
        self.strike = self.arms.T @ (MASS[:, None] * self.arms[::-1])

    def mass_matrix(self, q: Any) -> Any:
        difference = np.subtract.outer(q, q)
        return self.coupling * np.cos(difference) + np.diag(INERTIA)

    def acceleration(self, q: Any, rates: Any, torques: Any) -> Any:
        """Return q̈ for the torques of ankle, knee, hip to torso, hip to swing leg, knee."""
        difference = np.subtract.outer(q, q)
        centrifugal = (self.coupling * np.sin(difference)) @ (rates * rates)
        gravity = GRAVITY * self.weights * np.sin(q)
        right = torques - np.append(torques[1:], 0.0) - centrifugal + gravity
        return col.linear_solve(self.mass_matrix(q), right)

    def heel_strike(self, q: Any, rates: Any) -> tuple[Any, Any]:
        """Return angles and rates after the swing foot has hit the ground (F.9, F.10).

        The momentum along every motion of the new chain stays as it is: that is the angular
        momentum about the new foot and about every joint.
        """
        after = q[::-1]
        before = (self.strike * np.cos(np.subtract.outer(after, q))) @ rates
        momentum = before + INERTIA * rates[::-1]
        return after, col.linear_solve(self.mass_matrix(after), momentum)

    def energy(self, q: Any, rates: Any) -> Any:
        kinetic = 0.5 * rates @ (self.mass_matrix(q) @ rates)
        return kinetic + GRAVITY * self.weights @ np.cos(q)

    def points(self, q: Any) -> Any:
        """Return feet, knees, hip and shoulder: P0 to P5 as rows."""
        l1, l2, l3, l4, l5 = LENGTH
        knee = l1 * unit(q[0])
        hip = knee + l2 * unit(q[1])
        swing_knee = hip - l4 * unit(q[3])
        shoulder, foot = hip + l3 * unit(q[2]), swing_knee - l5 * unit(q[4])
        return [0.0 * knee, knee, hip, shoulder, swing_knee, foot]

    def foot_rise(self, q: Any, rates: Any) -> Any:
        """Return the vertical speed of the swing foot."""
        signed = np.array([1.0, 1.0, 0.0, -1.0, -1.0]) * LENGTH
        return -(signed * np.sin(q)) @ rates


def unit(angle: Any) -> Any:
    return np.array([-np.sin(angle), np.cos(angle)])


def problem(torso_from: str = "hip", knee_torque: float = -20.0) -> col.Problem:
    """Return the least ∫ Σ u² over a periodic step; the ankle of the stance foot has no torque.

    There are two gaits that are locally optimal. From a guess with no torque (7.11) a solver may
    find either; a guess with a torque of -20 N·m in the stance knee leads to the one in which that
    knee is pulled back at the start, which is the one of the published figures.
    """
    biped = Biped(torso_from)

    def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
        torques = np.concatenate([np.zeros(1), u])
        return [x[5:], biped.acceleration(x[:5], x[5:], torques)]

    def boundary(t0: Any, tf: Any, x0: Any, xf: Any) -> list[Any]:
        angles, rates = biped.heel_strike(xf[:5], xf[5:])
        foot = biped.points(xf[:5])[5]
        return [
            x0[:5] - angles,
            x0[5:] - rates,
            foot[0] - STEP,
            foot[1],
            biped.foot_rise(x0[:5], x0[5:]),
            biped.foot_rise(xf[:5], xf[5:]),
        ]

    first = np.array([-0.3, 0.7, 0.0, -0.5, -0.6])
    last = first[::-1]
    rates = (last - first) / DURATION
    joints = ["stance knee", "stance hip", "swing hip", "swing knee"]
    links = ["stance tibia", "stance femur", "torso", "swing femur", "swing tibia"]
    return col.Problem(
        dynamics=dynamics,
        nx=10,
        nu=4,
        tf=DURATION,
        objective=lambda t, x, u: u @ u,
        boundary=(boundary, [0.0] * 13 + [None], [0.0] * 12 + [None, 0.0]),
        guess=col.line(
            np.append(first, rates),
            np.append(last, rates),
            tf=DURATION,
            u=[knee_torque, 0, 0, 0],
        ),
        x_names=[
            *(f"{name} [rad]" for name in links),
            *(f"{name} rate [rad/s]" for name in links),
        ],
        u_names=[f"{name} [N·m]" for name in joints],
    )
