"""Kinematic tree of 1- and 3-dof joints out of a compiled MuJoCo model.

MuJoCo hangs several joints on one body, each turning about an anchor given in the body's frame, and
knows a free joint with 6 dofs.  Here every joint has a frame of its own whose origin is the anchor,

    T_j = T_parent(j) · offset_j · E_j(x_j),

with ``E_j`` a translation along an axis, a rotation about an axis, or exp([r]×).  A free joint
becomes slides along the world's x, y, z and a ball.  The order of the dofs is MuJoCo's order of
``qvel``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import rotations
from trajopt.model import BALL, HINGE, SLIDE
from trajopt.rigid import compose, rigid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Tree", "build_tree"]

_FREE_AXES = ("x", "y", "z")


@dataclass
class Tree:
    """Joints in the order of their dofs, and the bodies they carry.

    Attributes
    ----------
    joint_name, joint_type, joint_parent, joint_offset, joint_axis : list
        One entry a joint; the parent of a joint at the world is -1.
    dof_name, lower, upper : list
        One entry a dof; limits in rad or m, infinite where there are none.
    dof_free : list of bool
        Whether the dof belongs to a free joint.
    body_id, body_name, body_joint, body_offset : list
        The bodies that move, with MuJoCo's index, and T_body = T_joint · offset.
    attachment : list
        For every MuJoCo body, its joint (-1: fixed to the world) and its offset.
    limited_balls : list of str
        Ball joints with a limit, which has no counterpart here.
    """

    joint_name: list[str] = field(default_factory=list)
    joint_type: list[int] = field(default_factory=list)
    joint_parent: list[int] = field(default_factory=list)
    joint_offset: list[NDArray[Any]] = field(default_factory=list)
    joint_axis: list[NDArray[Any]] = field(default_factory=list)
    dof_name: list[str] = field(default_factory=list)
    dof_free: list[bool] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    body_id: list[int] = field(default_factory=list)
    body_name: list[str] = field(default_factory=list)
    body_joint: list[int] = field(default_factory=list)
    body_offset: list[NDArray[Any]] = field(default_factory=list)
    attachment: list[tuple[int, NDArray[Any]]] = field(default_factory=list)
    limited_balls: list[str] = field(default_factory=list)

    def add_joint(
        self, name: str, kind: int, parent: int, offset: NDArray[Any], axis: ArrayLike
    ) -> int:
        """Append a joint and return its index."""
        self.joint_name.append(name)
        self.joint_type.append(kind)
        self.joint_parent.append(parent)
        self.joint_offset.append(offset)
        self.joint_axis.append(np.asarray(axis, dtype=np.float64))
        return len(self.joint_name) - 1

    def add_dofs(
        self,
        names: list[str],
        limits: tuple[float, float] = (-np.inf, np.inf),
        *,
        free: bool = False,
    ) -> None:
        """Append dofs that share their limits."""
        self.dof_name += names
        self.dof_free += [free] * len(names)
        self.lower += [limits[0]] * len(names)
        self.upper += [limits[1]] * len(names)


def build_tree(m: Any) -> Tree:
    """Convert the bodies and joints of a compiled model.

    Parameters
    ----------
    m : mujoco.MjModel
        A model without anything that a tree cannot represent.

    Returns
    -------
    Tree
    """
    tree = Tree(attachment=[(-1, rigid())])
    for body in range(1, m.nbody):
        joint, frame = tree.attachment[m.body_parentid[body]]
        frame = compose(
            frame, rigid(m.body_pos[body], rotations.matrix_from_quaternion(m.body_quat[body]))
        )
        name = m.body(body).name or f"body_{body}"
        first = m.body_jntadr[body]
        for j in range(first, first + m.body_jntnum[body]):
            joint, frame = _add(tree, m, j, name, joint, frame)
        tree.attachment.append((joint, frame))
        if joint >= 0:
            tree.body_id.append(body)
            tree.body_name.append(name)
            tree.body_joint.append(joint)
            tree.body_offset.append(frame)
    return tree


def _add(
    tree: Tree, m: Any, j: int, body: str, parent: int, frame: NDArray[Any]
) -> tuple[int, NDArray[Any]]:
    """Append MuJoCo joint j, whose body stands at ``frame`` of joint ``parent`` before it moves.

    Returns the last joint and the body's frame in it.
    """
    kind = int(m.jnt_type[j])  # mjtJoint: 0 free, 1 ball, 2 slide, 3 hinge
    name = m.joint(j).name or (body if kind == 0 else f"{body}_joint_{j}")
    if kind == 0:
        for a, letter in enumerate(_FREE_AXES):
            parent = tree.add_joint(f"{name}_t{letter}", SLIDE, parent, rigid(), np.eye(3)[a])
            tree.add_dofs([f"{name}_t{letter}"], free=True)
        ball = tree.add_joint(f"{name}_r", BALL, parent, rigid(), (0, 0, 1))
        tree.add_dofs([f"{name}_r{letter}" for letter in _FREE_AXES], free=True)
        return ball, rigid()

    anchor = m.jnt_pos[j]
    axis = m.jnt_axis[j]
    offset = compose(frame, rigid(anchor))
    limits = (-np.inf, np.inf)
    if m.jnt_limited[j] and kind != 1:
        limits = (float(m.jnt_range[j, 0]), float(m.jnt_range[j, 1]))
    if kind == 1:
        if m.jnt_limited[j]:
            tree.limited_balls.append(name)
        joint = tree.add_joint(name, BALL, parent, offset, axis)
        tree.add_dofs([f"{name}_r{letter}" for letter in _FREE_AXES])
        return joint, rigid(-anchor)
    # MuJoCo's `ref`: the coordinate shown in the pose of the file; the motion starts from there.
    reference = float(m.qpos0[m.jnt_qposadr[j]])
    if kind == 2:
        offset = compose(offset, rigid(-reference * axis))
        joint = tree.add_joint(name, SLIDE, parent, offset, axis)
    else:
        offset = compose(offset, rigid(rotation=rotations.exp(-reference * axis)))
        joint = tree.add_joint(name, HINGE, parent, offset, axis)
    tree.add_dofs([name], limits)
    return joint, rigid(-anchor)
