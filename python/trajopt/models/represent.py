"""What of a compiled MuJoCo model can be represented, what cannot, and what does not matter."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.errors import ModelError
from trajopt.models.messages import listing

__all__ = ["actuated_dofs", "ignored", "refuse"]

_FREE, _BALL = 0, 1
# mjtTrn: the transmissions that act on a joint
_ON_JOINT = (0, 1)
_TRANSMISSIONS = ("joint", "joint", "slider-crank", "tendon", "site", "body")


def refuse(m: Any, label: str) -> None:
    """Refuse what changes the motion and has no counterpart in a tree of rigid bodies.

    Parameters
    ----------
    m : mujoco.MjModel
    label : str
        Name of the model in messages.

    Raises
    ------
    ModelError
        Naming the element: an active equality constraint (which also closes loops and couples
        joints), a tendon with limits or springs, a flexible body, a plugin, or no mass at all.
    """

    def name(kind: str, i: int) -> str:
        given = getattr(m, kind)(i).name
        return f"'{given}'" if given else f"number {i}"

    for i in range(m.neq):
        if m.eq_active0[i]:
            kind = str(_equality_name(int(m.eq_type[i])))
            raise ModelError(
                f"{label}: equality constraint {name('equality', i)} ({kind}"
                f"{_equality_objects(m, i)}) cannot be represented; remove it from the file"
            )
    for i in range(m.ntendon):
        if m.tendon_limited[i] or np.any(m.tendon_stiffness[i]):
            what = "limits" if m.tendon_limited[i] else "a spring"
            raise ModelError(
                f"{label}: tendon {name('tendon', i)} has {what}, which cannot be represented"
            )
    if m.nflex:
        import mujoco

        flex = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_FLEX, 0)
        raise ModelError(f"{label}: flex '{flex}' cannot be represented: bodies are rigid")
    for body in range(m.nbody):
        if m.body_plugin[body] >= 0:
            raise ModelError(f"{label}: plugin of body {name('body', body)} cannot be represented")
    if m.nv == 0:
        raise ModelError(f"{label}: nothing moves: there is no joint; base='floating' adds one")
    if not np.sum(m.body_mass[m.body_weldid != 0]) > 0:
        raise ModelError(f"{label}: the bodies that move have no mass")


def _equality_name(kind: int) -> str:
    import mujoco

    return str(mujoco.mjtEq(kind).name.removeprefix("mjEQ_").lower())


def _equality_objects(m: Any, i: int) -> str:
    """Return ' between a and b' with the joined objects, as far as they have names."""
    kind = _equality_name(int(m.eq_type[i]))
    if kind not in ("connect", "weld", "joint", "tendon"):
        return ""
    lookup = getattr(m, "body" if kind in ("connect", "weld") else kind)
    if kind in ("connect", "weld") and int(m.eq_objtype[i]) != 1:  # 1: mjOBJ_BODY; else sites
        lookup = m.site
    names = [lookup(int(j)).name for j in (m.eq_obj1id[i], m.eq_obj2id[i]) if j >= 0]
    return " of " + " and ".join(f"'{n}'" for n in names if n) if any(names) else ""


def ignored(m: Any, limited_balls: list[str]) -> list[str]:
    """Phrases for everything in the file that has no effect on a trajectory.

    Parameters
    ----------
    m : mujoco.MjModel
    limited_balls : list of str
        Ball joints with limits.

    Returns
    -------
    list of str
        Empty if nothing was ignored.
    """

    def names(kind: str, selected: Any) -> str:
        every = [getattr(m, kind)(int(i)).name or f"number {i}" for i in np.flatnonzero(selected)]
        return f"{kind if len(every) == 1 else kind + 's'} {listing(every)}"

    out = []
    passive: dict[str, list[str]] = {}  # one phrase for what concerns the same joints
    for what, per_dof in (
        ("damping", m.dof_damping.reshape(m.nv, -1)[:, 0]),
        ("dry friction", m.dof_frictionloss),
        ("armature", m.dof_armature),
    ):
        if np.any(per_dof):
            hit = np.isin(np.arange(m.njnt), m.dof_jntid[per_dof != 0])
            passive.setdefault(names("joint", hit), []).append(what)
    out += [f"{' and '.join(what)} of {joints}" for joints, what in passive.items()]
    stiffness = m.jnt_stiffness.reshape(m.njnt, -1)[:, 0]
    if np.any(stiffness):
        out.append(f"springs of {names('joint', stiffness != 0)}")
    if limited_balls:
        out.append(f"limits of ball joints {listing(limited_balls)}")
    if np.any(m.eq_active0 == 0):
        out.append(f"inactive {names('equality', m.eq_active0 == 0)}")
    for count, kind in ((m.ntendon, "tendon"), (m.nsensor, "sensor")):
        if count:
            out.append(names(kind, np.ones(count, dtype=bool)))
    if m.nu:
        out.append(f"gains and force ranges of {names('actuator', np.ones(m.nu, dtype=bool))}")
    if np.any(m.body_gravcomp):
        out.append(f"gravity compensation of {names('body', m.body_gravcomp != 0)}")
    if m.opt.density or m.opt.viscosity:
        out.append("the fluid around the bodies")
    if not np.allclose(m.opt.gravity, [0, 0, -9.81], atol=0.02):
        out.append(f"gravity {m.opt.gravity.tolist()} (set it on World instead)")
    return out


def actuated_dofs(m: Any, label: str, actuated: str) -> tuple[Any, list[str]]:
    """Which dofs have a motor.

    Parameters
    ----------
    m : mujoco.MjModel
    label : str
        Name of the model in messages.
    actuated : {"auto", "joints", "actuators"}
        "joints": all but those of free joints.  "actuators": those that actuators of the file act
        on.  "auto": the latter if the file has such actuators, otherwise the former.

    Returns
    -------
    mask : ndarray of bool, shape (D,)
    notes : list of str
        Joints that stay passive.

    Raises
    ------
    ModelError
        If an actuator does not act on the dofs of a joint one by one.
    """
    joint_free = m.jnt_type == _FREE
    every = ~joint_free[m.dof_jntid]
    if actuated == "joints" or (actuated == "auto" and m.nu == 0):
        return every, []
    if m.nu == 0:
        raise ModelError(f"{label}: actuated='actuators', but the file has no actuators")
    mask = np.zeros(m.nv, dtype=bool)
    balls: dict[int, list[Any]] = {}
    for i in range(m.nu):
        kind, joint = int(m.actuator_trntype[i]), int(m.actuator_trnid[i, 0])
        who = f"actuator '{m.actuator(i).name or i}'"
        if kind not in _ON_JOINT:
            what = _TRANSMISSIONS[kind] if 0 <= kind < len(_TRANSMISSIONS) else "plugin"
            raise ModelError(
                f"{label}: {who} acts on a {what}, which cannot be represented;"
                " actuated='joints' puts a motor on every joint instead"
            )
        if m.jnt_type[joint] == _FREE:
            raise ModelError(f"{label}: {who} acts on free joint '{m.joint(joint).name}'")
        if m.jnt_type[joint] == _BALL:
            balls.setdefault(joint, []).append(m.actuator_gear[i, :3])
        else:
            mask[m.jnt_dofadr[joint]] = True
    for joint, gears in balls.items():
        if np.linalg.matrix_rank(np.array(gears)) < 3:
            raise ModelError(
                f"{label}: ball joint '{m.joint(joint).name}' is driven about fewer than 3 axes;"
                " actuated='joints' puts a motor on every joint instead"
            )
        start = m.jnt_dofadr[joint]
        mask[start : start + 3] = True
    passive = [m.joint(int(j)).name or f"joint {j}" for j in np.unique(m.dof_jntid[every & ~mask])]
    return mask, [f"passive joints: {listing(passive, 8)}"] if passive else []
