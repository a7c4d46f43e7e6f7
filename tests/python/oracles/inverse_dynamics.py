"""Continuous inverse dynamics of other people: pinocchio's RNEA and MuJoCo's mj_inverse."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from trajopt.models.coordinates import to_qpos

from .reference import BALL, SLIDE

_H = 1e-4  # central differences: truncation and, taken twice, rounding of about 1e-8


class Curve:
    """x(t) = x + v t + a t²/2 in the coordinates themselves, rotation vectors included."""

    def __init__(self, x: Any, v: Any, a: Any) -> None:
        self.x, self.v, self.a = x, v, a

    def __call__(self, t: float) -> Any:
        return self.x + t * (self.v + 0.5 * t * self.a)


def pinocchio_force(arguments: dict[str, Any], curve: Curve) -> Any:
    """Generalized force at t = 0 along the coordinates x, by RNEA on a hand-made tree."""
    model = pin.Model()
    ids: list[int] = []
    for j, kind in enumerate(arguments["joint_type"]):
        axis, offset = arguments["joint_axis"][j], arguments["joint_offset"][j]
        joint = (
            pin.JointModelSpherical()
            if kind == BALL
            else pin.JointModelPrismaticUnaligned(axis)
            if kind == SLIDE
            else pin.JointModelRevoluteUnaligned(axis)
        )
        parent = int(arguments["joint_parent"][j])
        place = pin.SE3(offset[:, :3].copy(), offset[:, 3].copy())
        ids.append(model.addJoint(0 if parent < 0 else ids[parent], joint, place, f"joint_{j}"))
        moment = arguments["link_inertia"][j]
        if moment[3, 3] > 0.0:
            model.appendBodyToJoint(ids[-1], _inertia(moment), pin.SE3.Identity())
    data = model.createData()

    def configuration(x: Any) -> Any:
        q = []
        for kind, s in _dofs(arguments):
            q.extend(Rotation.from_rotvec(x[s : s + 3]).as_quat() if kind == BALL else x[s : s + 1])
        return np.array(q)

    def velocity(t: float) -> Any:
        ahead, behind = configuration(curve(t + _H)), configuration(curve(t - _H))
        middle = configuration(curve(t))
        forward, backward = (
            pin.difference(model, middle, ahead),
            pin.difference(model, middle, behind),
        )
        return (forward - backward) / (2 * _H)

    q = configuration(curve(0.0))
    acceleration = (velocity(_H) - velocity(-_H)) / (2 * _H)
    force = pin.rnea(model, data, q, velocity(0.0), acceleration)
    columns = []
    for unit in np.eye(len(curve.x)):
        forward = pin.difference(model, q, configuration(curve.x + _H * unit))
        backward = pin.difference(model, q, configuration(curve.x - _H * unit))
        columns.append((forward - backward) / (2 * _H))
    return np.array(columns) @ force


def mujoco_force(xml: str, curve: Curve) -> Any:
    """The same by mj_inverse on the model's own file, nothing but masses and gravity."""
    model = mujoco.MjModel.from_xml_string(xml)
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_CONSTRAINT | flags.mjDSBL_CONTACT
    model.opt.gravity[:] = (0.0, 0.0, -9.81)
    for field in (
        model.dof_armature,
        model.dof_damping,
        model.dof_frictionloss,
        model.jnt_stiffness,
    ):
        field[:] = 0.0
    data = mujoco.MjData(model)

    def tangent(a: Any, b: Any, dt: float) -> Any:
        out = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, out, dt, to_qpos(model, a), to_qpos(model, b))
        return out

    def velocity(t: float) -> Any:
        middle = curve(t)
        return (tangent(middle, curve(t + _H), _H) - tangent(middle, curve(t - _H), _H)) / 2

    data.qpos[:] = to_qpos(model, curve(0.0))
    data.qvel[:] = velocity(0.0)
    data.qacc[:] = (velocity(_H) - velocity(-_H)) / (2 * _H)
    mujoco.mj_inverse(model, data)
    columns = [
        (tangent(curve.x, curve.x + _H * unit, _H) - tangent(curve.x, curve.x - _H * unit, _H)) / 2
        for unit in np.eye(len(curve.x))
    ]
    return np.array(columns) @ data.qfrc_inverse


def _dofs(arguments: dict[str, Any]) -> list[tuple[int, int]]:
    out, start = [], 0
    for kind in arguments["joint_type"]:
        out.append((int(kind), start))
        start += 3 if kind == BALL else 1
    return out


def _inertia(moment: Any) -> Any:
    mass = moment[3, 3]
    centre = moment[:3, 3] / mass
    spread = moment[:3, :3] - mass * np.outer(centre, centre)
    return pin.Inertia(mass, centre, np.trace(spread) * np.eye(3) - spread)
