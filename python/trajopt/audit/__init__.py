"""How true is a motion? Checks that share no code path with the solver that made it."""

from __future__ import annotations

from trajopt.audit.between import fine_residual, fine_times, fine_violation, residual_work
from trajopt.audit.contacts import ContactState, contact_state, count_changes, flights
from trajopt.audit.motion import Motion
from trajopt.audit.replay import Replay, replay_drift
from trajopt.audit.report import Audit, audit

__all__ = [
    "Audit",
    "ContactState",
    "Motion",
    "Replay",
    "audit",
    "contact_state",
    "count_changes",
    "fine_residual",
    "fine_times",
    "fine_violation",
    "flights",
    "replay_drift",
    "residual_work",
]
