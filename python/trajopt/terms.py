"""Translates objective terms into the core's arrays, per frame and dimensionless."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt import _core
from trajopt.checks import finite_array, non_negative, number, numbers
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.kinematics import BALL, SLIDE
from trajopt.scaling import Scales

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.problem import Problem
    from trajopt.traced import Trace, TracedResidual

__all__ = ["TermBuilder", "has_free_base"]

FloatArray = NDArray[np.float64]


class TermBuilder:
    """Collects the terms of one problem; D degrees of freedom, N frames.

    Parameters
    ----------
    model : Model
    core : _core.Model
        The model in scaled units.
    scales : Scales
    times : (N,) array
        Times of the frames [s].
    steps : (N,) array
        Steps that lead to them [s].
    initial : (D,) array
        Settled pose [m, rad].
    """

    def __init__(
        self,
        model: Model,
        core: Any,
        scales: Scales,
        times: FloatArray,
        steps: FloatArray,
        initial: FloatArray,
    ) -> None:
        self.model = model
        self.core = core
        self.scales = scales
        self.times = times
        self.frames = len(times)
        self.objective = _core.Objective()
        self.factor = 1.0
        self._share = steps / steps.sum()
        self._initial = initial
        self._label = ""
        self._counts: FloatArray | float = 1.0
        self.residuals: dict[str, TracedResidual] = {}  # of the user, by label

    @classmethod
    def of(cls, problem: Problem) -> TermBuilder:
        """Return the builder that finds mistakes in terms before anything is solved."""
        model, scales = problem.model, Scales.of(problem.model, problem.gravity)
        core = _core.Model(**model.core_arguments(scales.mass, scales.length))
        return cls(model, core, scales, problem.times, problem.steps, problem.initial.pose)

    def start(self, label: str, factor: float, counts: FloatArray | float = 1.0) -> None:
        """Begin a term: its name, the factor that normalizes it, and which frames count."""
        self._label = label
        self.factor = factor
        self._counts = counts

    # ---- weights over frames ---------------------------------------------------------------------

    def all_frames(self, weight: float) -> FloatArray:
        """Weights whose sum over a constant residual is `weight`."""
        return np.asarray(weight * self._share)

    def at_times(self, owner: str, time: Any, weight: float) -> FloatArray:
        """Weights on the frames nearest to `time` (float or sequence), or on all frames."""
        if time is None:
            return self.all_frames(weight)
        out = np.zeros(self.frames)
        indices = self._indices(owner, time)
        np.add.at(out, indices, weight / len(indices))
        return out

    def after(self, owner: str, start: float, weight: float) -> FloatArray:
        """Weights on the frames from `start` [s] on; they add up to `weight`."""
        counts = self.times >= non_negative(owner, "start", start)
        if not counts.any():
            raise ArgumentError(
                f"{owner}: start = {start:g} s lies behind the end at {self.times[-1]:g} s"
            )
        share = self._share * counts
        return np.asarray(weight * share / share.sum())

    def last_frames(self, count: int, weight: float) -> FloatArray:
        """`weight` on each of the last `count` frames."""
        out = np.zeros(self.frames)
        out[-count:] = weight
        return out

    def _indices(self, owner: str, time: Any) -> NDArray[np.intp]:
        wanted = finite_array(owner, "time", np.atleast_1d(numbers(owner, "time", time)), (None,))
        half = 0.51 * (self.times[-1] - self.times[0]) / max(self.frames - 1, 1)
        for t in wanted:
            if not self.times[0] - half <= t <= self.times[-1] + half:
                raise ArgumentError(
                    f"{owner}: time = {t:g} s lies outside the motion, "
                    f"which lasts from 0 to {self.times[-1]:g} s"
                )
        return np.asarray(np.argmin(np.abs(self.times[None] - wanted[:, None]), axis=1))

    # ---- targets ---------------------------------------------------------------------------------

    def targets(
        self, owner: str, position: Any, time: Any, weight: float
    ) -> tuple[FloatArray, FloatArray]:
        """Weights (N,) and scaled positions (N, 3) of a target, or of K targets at K times."""
        array = numbers(owner, "position", position)
        shape: tuple[int | None, ...] = (3,) if array.ndim == 1 else (None, 3)
        array = finite_array(owner, "position", position, shape) / self.scales.length
        target = np.zeros((self.frames, 3))
        if array.ndim == 1:
            target[:] = array
            return self.at_times(owner, time, weight), target
        indices = self._matching(owner, time, len(array), "positions")
        target[indices] = array
        return self.at_times(owner, time, weight), target

    def _matching(self, owner: str, time: Any, count: int, what: str) -> NDArray[np.intp]:
        if time is None or np.size(time) != count:
            raise ArgumentError(
                f"{owner}: {count} {what} need as many times, "
                f"got {0 if time is None else np.size(time)}"
            )
        indices = self._indices(owner, time)
        if len(np.unique(indices)) < count:
            raise ArgumentError(
                f"{owner}: {count} {what} fall on {len(np.unique(indices))} frames; times must "
                "lie at least a time step apart"
            )
        return indices

    def poses(
        self, owner: str, pose: Any, dofs: Sequence[str] | None, keep_height: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Poses (K, D) in SI, and which coordinates count (D,)."""
        names = list(self.model.dof_names)
        count = self.model.actuated.astype(float)
        if keep_height:  # all but place in the plane and heading
            count = np.ones(self.model.ndof)
            count[[0, 1, 5] if has_free_base(self.model) else []] = 0
        if isinstance(pose, str):
            if pose != "initial":
                raise ArgumentError(f"{owner}: pose = {pose!r}, expected an array or 'initial'")
            array = self._initial[None]
        elif isinstance(pose, Mapping):
            array = self._initial.copy()
            for name, value in pose.items():
                array[self._dof(owner, names, name)] = number(owner, f"pose[{name!r}]", value)
            dofs = list(pose) if dofs is None else dofs
            array = array[None]
        else:
            one = numbers(owner, "pose", pose).ndim == 1
            shape = (self.model.ndof,) if one else (None, self.model.ndof)
            array = np.atleast_2d(finite_array(owner, "pose", pose, shape))
        if dofs is not None:
            dofs = [dofs] if isinstance(dofs, str) else dofs
            if not isinstance(dofs, Sequence):
                raise ArgumentTypeError(f"{owner}: dofs must be a list of names, not {dofs!r}")
            if not dofs:
                raise ArgumentError(
                    f"{owner}: names no coordinate; the model has {', '.join(names)}"
                )
            count = np.zeros(self.model.ndof)
            for name in dofs:
                count[self._dof(owner, names, name)] = 1
        return array, count

    @staticmethod
    def _dof(owner: str, names: list[str], name: str) -> int:
        if name not in names:
            raise ArgumentError(
                f"{owner}: no coordinate is called {name!r}; the model has {', '.join(names)}"
            )
        return names.index(name)

    def pose_targets(
        self, owner: str, poses: FloatArray, time: Any, weight: float
    ) -> tuple[FloatArray, FloatArray]:
        """Weights (N,) and target poses (N, D) in SI."""
        target = np.tile(poses[0], (self.frames, 1))
        if len(poses) > 1:
            target[self._matching(owner, time, len(poses), "poses")] = poses
        return self.at_times(owner, time, weight), target

    @property
    def initial_center_of_mass(self) -> FloatArray:
        """Center of mass of the settled pose, scaled (3,)."""
        scaled = self._scaled(self._initial[None])
        return np.asarray(self.core.center_of_mass(scaled)[0])

    def body_point(self, owner: str, body: str, point: Any) -> tuple[int, FloatArray]:
        """Joint that carries a body's point, and the point in the joint's frame, scaled."""
        if body not in self.model.body_names:
            raise ArgumentError(
                f"{owner}: no body is called {body!r}; "
                f"the model has {', '.join(self.model.body_names)}"
            )
        k = self.model.body_names.index(body)
        offset = self.model.body_offset[k]
        local = offset[:, :3] @ finite_array(owner, "point", point, (3,)) + offset[:, 3]
        return int(self.model.body_joint[k]), local / self.scales.length

    # ---- output ----------------------------------------------------------------------------------

    def dense(
        self,
        kind: str,
        weight: FloatArray,
        target: FloatArray | None = None,
        axes: Sequence[float] = (1.0, 1.0, 1.0),
        place: tuple[int, FloatArray] | None = None,
    ) -> None:
        """Add a term with rows across the tree."""
        if target is not None:
            target = np.broadcast_to(target, (self.frames, 3))
        joint, point = place if place is not None else (0, np.zeros(3))
        self.objective.add_dense(
            self._label,
            kind,
            weight * self.factor * self._counts,
            target=target,
            joint=joint,
            point=tuple(point),
            axes=tuple(np.asarray(axes, dtype=np.float64)),
        )

    def local(
        self,
        kind: str,
        weight: FloatArray,
        dof_weight: FloatArray,
        target: FloatArray | None = None,
        suffix: str = "",
    ) -> None:
        """Add a term that each joint pays by itself; pose targets in SI."""
        if target is not None:
            target = _core.configuration_from_vector(self.core, self._scaled(target))
        self.objective.add_local(
            self._label + suffix,
            kind,
            weight * self.factor * self._counts,
            dof_weight,
            target=target,
        )

    def traced(self, trace: Trace, weight: float) -> None:
        """Add a user's residual."""
        from trajopt.traced import TracedResidual

        share = self.all_frames(weight * self.factor)
        traced = TracedResidual(trace, self.model, self.core, self.scales, share)
        self.residuals[self._label] = traced
        self.objective.add_callback(
            self._label, traced.rows, 1.0, self.frames, self.core, traced.at
        )

    def _scaled(self, x: FloatArray) -> FloatArray:
        return x / self.scales.coordinate


def has_free_base(model: Model) -> bool:
    """Return whether the first six coordinates are an unactuated free base."""
    return (
        model.ndof >= 6
        and list(model.joint_type[:4]) == [SLIDE, SLIDE, SLIDE, BALL]
        and not model.actuated[:6].any()
    )
