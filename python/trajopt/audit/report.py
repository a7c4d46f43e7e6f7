"""All figures that say how true a motion is, in one table."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from trajopt.audit.between import fine_violation, residual_work
from trajopt.audit.contacts import LOADED_SHARE, contact_state, count_changes, flights
from trajopt.audit.motion import Motion
from trajopt.audit.replay import replay_drift
from trajopt.norms import largest, rms

__all__ = ["Audit", "audit"]


@dataclass(frozen=True)
class Audit:
    """How well a motion satisfies physics, by means that the solver did not use.

    Parameters
    ----------
    body_weight : float
        Weight of the character [N].
    length : float
        Its characteristic length [m].
    frame_violation_max, frame_violation_rms : float
        Unactuated residual at the frames [N, N·m].
    fine_violation_max, fine_violation_rms : float
        The same between the frames, of the C² interpolant [N, N·m].
    replay_duration : float
        Length of the replays [s].
    replay_rms, replay_max : float
        Drift of the root after a replay [m].
    work_gained, work_lost : float
        Work of the missing forces between the frames, the positive and the negative part [J].
    penetration_max, penetration_rms : float
        Depth of contact points, the latter over those that touch [m].
    slip_rms, slip_max : float
        Slip speed, weighted with depth², and the largest of a point that carries more than 5 % of
        the weight [m/s].
    cone_max : float
        Largest ratio of friction to normal force of such a point.
    limit_excess : float
        Largest violation of a joint limit [m, rad].
    contact_changes : dict of str to (int, int)
        How often each body took up load (above 5 % of the weight) and lost it (below 1 %).
    contact_share : dict of str to float
        Share of the frames in which each body carries more than 5 % of the weight.
    flights : list of (float, float)
        Begin and end of every time without support [s].
    apex_height, apex_time : float
        Largest height of the center of mass [m] and when it is reached [s].
    """

    body_weight: float
    length: float
    frame_violation_max: float
    frame_violation_rms: float
    fine_violation_max: float
    fine_violation_rms: float
    replay_duration: float
    replay_rms: float
    replay_max: float
    work_gained: float
    work_lost: float
    penetration_max: float
    penetration_rms: float
    slip_rms: float
    slip_max: float
    cone_max: float
    limit_excess: float
    contact_changes: dict[str, tuple[int, int]]
    contact_share: dict[str, float]
    flights: list[tuple[float, float]]
    apex_height: float
    apex_time: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain Python values."""
        return asdict(self)

    def __str__(self) -> str:
        weight, length = self.body_weight, self.length
        force, size = f"of {weight:.4g} N", f"of {length:.4g} m"
        rows: list[tuple[str, float, str, float | None, str]] = [
            ("frame residual, max", self.frame_violation_max, "N, N·m", weight, force),
            ("frame residual, rms", self.frame_violation_rms, "N, N·m", weight, force),
            ("between frames, max", self.fine_violation_max, "N, N·m", weight, force),
            ("between frames, rms", self.fine_violation_rms, "N, N·m", weight, force),
            (f"drift in {self.replay_duration:.2g} s, max", self.replay_max, "m", length, size),
            (f"drift in {self.replay_duration:.2g} s, rms", self.replay_rms, "m", length, size),
            ("work from nowhere", self.work_gained, "J", weight * length, "of weight · length"),
            ("work lost", self.work_lost, "J", weight * length, "of weight · length"),
            ("penetration, max", self.penetration_max, "m", length, size),
            ("penetration, rms", self.penetration_rms, "m", length, size),
            ("slip, loaded points, max", self.slip_max, "m/s", None, ""),
            ("slip, weighted rms", self.slip_rms, "m/s", None, ""),
            ("friction / normal force, max", self.cone_max, "", None, ""),
            ("joint limit excess", self.limit_excess, "m, rad", None, ""),
            (
                "apex of the center of mass",
                self.apex_height,
                "m",
                None,
                f"at {self.apex_time:.2f} s",
            ),
        ]
        lines = []
        for name, value, unit, scale, note in rows:
            share = "" if scale is None else f"{100.0 * value / scale:10.3g} %"
            lines.append(f"{name:<30}{value:>11.3g} {unit:<7}{share:>12} {note}".rstrip())
        touching = [body for body, share in self.contact_share.items() if share > 0.0]
        for body in touching:
            makes, breaks = self.contact_changes[body]
            lines.append(
                f"contact of {body:<19}{makes:>11d} made, {breaks} broken,"
                f" {100.0 * self.contact_share[body]:.3g} % of the time"
            )
        if not touching:
            lines.append(f"{'contact':<30}{'none':>11}")
        spans = ", ".join(f"{a:.2f}-{b:.2f}" for a, b in self.flights) or "none"
        lines.append(f"{'flight [s]':<30}{spans:>11}")
        return "\n".join(lines)


def audit(motion: Motion) -> Audit:
    """Check a motion against physics by means that the solver did not use.

    Parameters
    ----------
    motion : Motion
        N frames, or a `Solution`.

    Returns
    -------
    Audit

    Notes
    -----
    Frames are checked by the scheme they were made with, everything else on the C² interpolant:
    inverse dynamics at four points a frame, a replay of the base from every frame, contact forces
    with the velocities of the interpolant.
    """
    model = motion.model
    state = contact_state(motion)
    replay = replay_drift(motion)
    gained, lost = residual_work(motion)
    frame = np.asarray(motion.frame_violation)
    fine = fine_violation(motion)
    center = model.center_of_mass(motion.x)
    apex = int(np.argmax(center[:, 2]))
    load = {model.body_names[j]: load for j, load in state.load().items()}
    excess = np.maximum(motion.x - model.upper, model.lower - motion.x)
    return Audit(
        body_weight=state.body_weight,
        length=float(model.length),
        frame_violation_max=largest(frame),
        frame_violation_rms=rms(frame),
        fine_violation_max=largest(fine),
        fine_violation_rms=rms(fine),
        replay_duration=replay.duration,
        replay_rms=replay.rms,
        replay_max=replay.max,
        work_gained=gained,
        work_lost=lost,
        penetration_max=largest(state.depth),
        penetration_rms=state.penetration_rms,
        slip_rms=state.slip_rms,
        slip_max=state.slip_max,
        cone_max=state.cone_max,
        limit_excess=float(np.max(excess, initial=0.0)),
        contact_changes={
            body: count_changes(force, state.body_weight) for body, force in load.items()
        },
        contact_share={
            body: float(np.mean(force > LOADED_SHARE * state.body_weight))
            for body, force in load.items()
        },
        flights=flights(state),
        apex_height=float(center[apex, 2]),
        apex_time=float(motion.times[apex]),
    )
