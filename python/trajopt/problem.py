"""What is to be solved: a model in a world, a time grid and the terms of the objective."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import choice, finite_array, non_negative, positive, whole
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.initial import InitialState, parse_initial
from trajopt.physics import INTEGRATORS, InternalForces
from trajopt.world import Contact, World

if TYPE_CHECKING:
    from collections.abc import Sequence

    from trajopt.model import Model
    from trajopt.objectives.base import Term

__all__ = ["Problem"]

FloatArray = NDArray[np.float64]

MIN_FRAMES = 4


class Problem:
    """A trajectory optimization problem.

    Parameters
    ----------
    model : Model
        The character, D degrees of freedom.
    duration : float
        Length of the motion [s].
    dt : float or (N,) sequence
        Time step [s], or the steps that lead to the frames of an uneven grid; the motion has
        N = round(duration / dt) frames.
    formulation : {"frames", "spline"}
        Unknowns: every frame (physics holds at every frame), or the control points of a Hermite
        spline (Pan: physics holds when tested with the spline's basis).
    frames_per_knot : int
        Frames per spline segment, at least 2; N must be a multiple of it.
    integrator : str
        ``implicit`` (Pan eq. 5), ``verlet``, ``fox_goodwin``, ``linear_acceleration`` or
        ``trapezoidal``.
    world : World, optional
        A ground plane at z = 0 by default.
    contact : Contact, optional
        Law of the contact force; numbers it leaves open are chosen for the model.
    initial : optional
        Pose the motion starts from: None or "home", an array (D,), or a dict with any of ``pose``
        ("home", an array, or coordinates by name), ``height`` (of the lowest point above the
        ground [m]; the pose then starts in the air), ``velocity`` (by name, or an array (D,)
        [m/s, rad/s]). Poses near the ground are settled on it.
    periodic : bool
        Close the motion to a ring: the gait repeats after `duration`, moved by `stride`.
    stride : (3,) sequence
        Displacement after one period [m].
    limit, self_collision : float
        Stiffness of joint limits and self collision, dimensionless; see `InternalForces`.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        One line that names argument, value and what was expected.

    Examples
    --------
    >>> import trajopt
    >>> problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.025)
    >>> problem.frames
    40
    >>> trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.0)
    Traceback (most recent call last):
    ...
    trajopt.errors.ArgumentError: Problem: dt must be > 0, not 0.0
    """

    def __init__(
        self,
        model: Model,
        duration: float,
        dt: float | Sequence[float] | FloatArray,
        formulation: Literal["frames", "spline"] = "frames",
        frames_per_knot: int = 10,
        integrator: str = "linear_acceleration",
        world: World | None = None,
        contact: Contact | None = None,
        initial: Any = None,
        periodic: bool = False,
        stride: Sequence[float] = (0.0, 0.0, 0.0),
        limit: float = 30.0,
        self_collision: float = 300.0,
    ) -> None:
        from trajopt.model import Model

        if not isinstance(model, Model):
            raise ArgumentTypeError(
                f"Problem: model must be a Model (see load_model), not {type(model).__name__}"
            )
        choice("Problem", "integrator", integrator, INTEGRATORS)
        choice("Problem", "formulation", formulation, ("frames", "spline"))
        _instance("world", world, World)
        _instance("contact", contact, Contact)
        self.model = model
        self.duration = positive("Problem", "duration", duration)
        self.steps = _steps(self.duration, dt)
        self.formulation = formulation
        self.frames_per_knot = whole("Problem", "frames_per_knot", frames_per_knot, 2)
        self.integrator = integrator
        self.world = World() if world is None else world
        if contact is None and self.world.obstacles:
            contact = Contact()
        self.contact = contact
        self.periodic = bool(periodic)
        self.stride = finite_array("Problem", "stride", stride, (3,))
        self.internal = InternalForces(
            non_negative("Problem", "limit", limit),
            non_negative("Problem", "self_collision", self_collision),
        )
        self.initial: InitialState = parse_initial(model, self.world, initial)
        self.terms: list[Term] = []
        self._check_grid()

    def _check_grid(self) -> None:
        if self.formulation == "spline":
            per = self.frames_per_knot
            if self.frames % per != 0 or self.frames < 2 * per:
                raise ArgumentError(
                    f"Problem: {self.frames} frames (duration / dt) must be a multiple of "
                    f"frames_per_knot = {per}, at least twice"
                )
            if not np.allclose(self.steps, self.steps[0], rtol=1e-9):
                raise ArgumentError("Problem: the spline needs one dt for all frames")
        if self.periodic and (self.formulation != "frames" or self.frames % 2 or self.frames < 8):
            raise ArgumentError(
                "Problem: periodic = True needs formulation 'frames' and an even number of at "
                f"least 8 frames, not {self.formulation!r} and {self.frames}"
            )
        if self.periodic and not np.isclose(self.steps[0], self.steps[-1], rtol=1e-9):
            raise ArgumentError(
                "Problem: periodic = True needs a first and a last step of the same length, not "
                f"{self.steps[0]:g} and {self.steps[-1]:g} s"
            )

    @property
    def frames(self) -> int:
        """Number of frames N."""
        return len(self.steps)

    @property
    def times(self) -> FloatArray:
        """Times of the frames 1..N [s], shape (N,)."""
        return np.asarray(np.cumsum(self.steps))

    @property
    def gravity(self) -> float:
        """Magnitude of gravity [m/s²]."""
        return float(np.linalg.norm(self.world.gravity))

    def add(self, *terms: Term) -> Problem:
        """Add terms to the objective.

        Parameters
        ----------
        *terms : terms of `trajopt.objectives`

        Returns
        -------
        Problem
            The problem itself, so that calls can be chained.

        Raises
        ------
        ArgumentError, ArgumentTypeError
            A term does not fit the model or the time grid: a wrong shape, a body that does not
            exist, a time after the end. None of `terms` is added then.

        Examples
        --------
        >>> import trajopt
        >>> problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.025)
        >>> problem.add(trajopt.objectives.CenterOfMassVelocity((1, 0, 0), start=2))
        Traceback (most recent call last):
        ...
        trajopt.errors.ArgumentError: CenterOfMassVelocity: start = 2 s lies behind the end at 1 s
        """
        from trajopt.objectives.base import Term
        from trajopt.terms import TermBuilder

        for term in terms:
            if isinstance(term, (list, tuple)):
                raise ArgumentTypeError(
                    f"Problem.add: got a {type(term).__name__} of terms; unpack it with a star: "
                    "problem.add(*regularizers())"
                )
            if not isinstance(term, Term):
                raise ArgumentTypeError(
                    "Problem.add: expected a term of trajopt.objectives, got "
                    f"{type(term).__name__}; terms are objects, such as ControlEffort(weight=0.1)"
                )
        trial = TermBuilder.of(self)
        for term in terms:
            term.emit(trial)
        self.terms.extend(terms)
        return self

    def with_steps(self, steps: FloatArray) -> Problem:
        """Return the same problem on another time grid of the same duration."""
        other = object.__new__(Problem)
        other.__dict__.update(self.__dict__)
        other.steps = np.asarray(steps, dtype=np.float64)
        other.terms = list(self.terms)
        other._check_grid()
        return other


def _instance(argument: str, value: Any, kind: type) -> None:
    if value is not None and not isinstance(value, kind):
        raise ArgumentTypeError(
            f"Problem: {argument} must be a {kind.__name__} or None, not {type(value).__name__}"
        )


def _steps(duration: float, dt: Any) -> FloatArray:
    if np.ndim(dt) == 0:
        step = positive("Problem", "dt", dt)
        count = round(duration / step)
        if count < MIN_FRAMES or abs(count * step - duration) > 1e-6 * duration + 1e-12:
            raise ArgumentError(
                f"Problem: duration = {duration:g} s must be a multiple of dt = {step:g} s, "
                f"at least {MIN_FRAMES} frames"
            )
        return np.full(count, step)
    steps = finite_array("Problem", "dt", dt, (None,))
    if len(steps) < MIN_FRAMES or np.any(steps <= 0):
        raise ArgumentError(f"Problem: dt must hold at least {MIN_FRAMES} steps > 0")
    if abs(steps.sum() - duration) > 1e-6 * duration:
        raise ArgumentError(
            f"Problem: the steps dt add up to {steps.sum():g} s, duration is {duration:g} s"
        )
    return steps
