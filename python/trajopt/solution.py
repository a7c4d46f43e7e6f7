"""The result of a solve: motion, torques, contact forces and how well physics holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.norms import largest, rms
from trajopt.records import IterationRecord
from trajopt.status import Status

if TYPE_CHECKING:
    import os

    from trajopt.audit import Audit
    from trajopt.model import Model
    from trajopt.world import Contact, World

__all__ = ["Solution"]

FloatArray = NDArray[np.float64]


def _empty(*shape: int) -> Any:
    """Return a dataclass field whose default is an array of zeros of `shape`."""
    return field(default_factory=lambda: np.zeros(shape))


@dataclass(eq=False, repr=False)
class Solution:
    """A motion found by `trajopt.solve`.

    D degrees of freedom, N frames, Z control points, P contact points, nu actuated degrees of
    freedom. SI units, radians, z up.

    Parameters
    ----------
    model : Model
        The character that moves.
    status : Status
        Why the solver stopped.
    message : str
        The same in a sentence with the numbers that caused it.
    x : (N, D) array
        Generalized coordinates of every frame [m, rad].
    times : (N,) array
        Time of every frame [s].
    dt : float or (N,) array
        Time step [s], or the steps that lead to the frames of a grid that is not uniform.
    initial : (2, D) array
        Frames 0 and -1, from which the motion starts [m, rad].
    world, contact : World, Contact
        What the character touched and how.
    integrator : str
        Time scheme that the frames obey.
    u : (N, nu) array
        Generalized forces of the actuated degrees of freedom [N, N·m].
    control_points : (Z, 2, D) array
        Value and time derivative of the coordinates at the knots of the grid [m, rad, 1/s].
    contact_forces, contact_points : (N, P, 3) arrays
        Force of the world on every contact point [N] and where it acts [m].
    center_of_mass : (N, 3) array
        Center of mass of the character [m].
    iterations : int
        Number of solver iterations over all stages.
    objective : float
        Weighted sum of all objective terms (dimensionless).
    objective_terms : dict of str to float
        The same by name of the term.
    constraint_violation : float
        ‖C‖∞ of the (reduced) dynamics constraints [N, N·m].
    frame_violation : (N,) array
        Largest unactuated residual of every frame [N, N·m].
    fine_violation : (4N,) array
        The same between the frames, four points a frame [N, N·m].
    body_weight : float
        Weight of the character, by which violations are compared [N].
    seconds : float
        Wall time of the solve [s].
    device : str
        Where it ran: ``cpu`` or ``cuda``.
    ordering : str
        Elimination order of the KKT system: ``frontal``, ``sequential``, ``cyclic`` or
        ``chunked``; of several passes, the last one's. A motion that no solver found says
        ``auto``, as older files may.
    seed : int
        Seed of the noise on the start.
    history : list of IterationRecord
        One record per iteration.
    settings : dict
        Scenario and solver settings as JSON values: what else is needed to solve again.

    Examples
    --------
    >>> import trajopt
    >>> model = trajopt.load_model("chain")
    >>> still = Solution(
    ...     model, Status.SOLVED, "at rest", np.tile(model.home, (4, 1)), np.arange(4) * 0.1, 0.1
    ... )
    >>> still.frames, still.converged
    (4, True)
    """

    model: Model
    status: Status
    message: str
    x: FloatArray
    times: FloatArray
    dt: float | FloatArray
    initial: FloatArray = _empty(2, 0)
    world: World | None = None
    contact: Contact | None = None
    integrator: str = "linear_acceleration"
    u: FloatArray = _empty(0, 0)
    control_points: FloatArray = _empty(0, 2, 0)
    contact_forces: FloatArray = _empty(0, 0, 3)
    contact_points: FloatArray = _empty(0, 0, 3)
    center_of_mass: FloatArray = _empty(0, 3)
    iterations: int = 0
    objective: float = float("nan")
    objective_terms: dict[str, float] = field(default_factory=dict)
    constraint_violation: float = float("nan")
    frame_violation: FloatArray = _empty(0)
    fine_violation: FloatArray = _empty(0)
    body_weight: float = float("nan")
    seconds: float = 0.0
    device: str = "cpu"
    ordering: str = "auto"
    seed: int = 0
    history: list[IterationRecord] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Solution of '{self.model.name}': {self.frames} frames, {self.status}>"

    @property
    def frames(self) -> int:
        """Number of frames N."""
        return len(self.x)

    @property
    def converged(self) -> bool:
        """Whether all tolerances of the solver were met."""
        return self.status.converged

    def summary(self) -> dict[str, Any]:
        """Return the figures that describe the solve, as JSON values.

        Returns
        -------
        dict
            ``status``, ``message``, ``iterations``, ``objective``, ``constraint_violation``
            [N, N·m], ``frame_violation_max``, ``frame_violation_rms``, ``fine_violation_rms``
            (shares of the body weight), ``body_weight`` [N], ``seconds`` [s], ``device``,
            ``ordering``.
            Figures that are not known are None.
        """
        weight = self.body_weight
        return {
            "status": str(self.status),
            "message": self.message,
            "iterations": self.iterations,
            "objective": _number(self.objective),
            "constraint_violation": _number(self.constraint_violation),
            "frame_violation_max": _number(largest(self.frame_violation, np.nan) / weight),
            "frame_violation_rms": _number(rms(self.frame_violation, np.nan) / weight),
            "fine_violation_rms": _number(rms(self.fine_violation, np.nan) / weight),
            "body_weight": _number(weight),
            "seconds": self.seconds,
            "device": self.device,
            "ordering": self.ordering,
        }

    def audit(self) -> Audit:
        """Check the motion against physics by means that the solver did not use.

        Returns
        -------
        Audit
            Residuals as shares of the body weight, replay drift, residual work, penetration,
            slip, friction cone and joint limits. See `trajopt.audit.audit`.
        """
        from trajopt.audit import audit

        return audit(self)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the solution to a ``.npz`` file; `path` is replaced in one step or not at all.

        Parameters
        ----------
        path : path-like
            File to write. Missing folders are made.
        """
        from trajopt.storage import save_solution

        save_solution(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Solution:
        """Read a solution written by `save`. No code in the file is ever executed.

        Parameters
        ----------
        path : path-like
            File to read.

        Returns
        -------
        Solution

        Raises
        ------
        FileFormatError
            If the file is missing, damaged or not a trajectory.
        """
        from trajopt.storage import load_solution

        return load_solution(path)


def _number(value: float) -> float | None:
    """Return `value`, or None where JSON has no name for it."""
    return float(value) if np.isfinite(value) else None
