"""Free or fix the root of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from trajopt.errors import ModelError

if TYPE_CHECKING:
    from trajopt.models.source import Source

__all__ = ["set_base"]


def set_base(source: Source, base: str) -> list[str]:
    """Free or fix the root bodies.

    Parameters
    ----------
    source : Source
    base : {"auto", "floating", "fixed"}
        "auto" keeps MJCF as it is, and frees the root of a URDF unless its root link is called
        ``world``.

    Returns
    -------
    list of str
        What was done, for the model's notes.

    Raises
    ------
    ModelError
        If a root that shall float has joints of its own.
    """
    import mujoco

    spec = source.spec
    roots = list(spec.worldbody.bodies)
    free = {
        body.name: [j for j in body.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
        for body in roots
    }
    if base == "auto":
        base = "floating" if source.urdf and not source.grounded else ""
    notes = []
    if base == "floating":
        for body in roots:
            if free[body.name] or not _moves(body):
                continue
            if list(body.joints):
                raise ModelError(
                    f"{source.label}: base='floating' needs a root body without joints, but"
                    f" '{body.name}' has joint '{body.joints[0].name}'"
                )
            body.add_freejoint()
            notes.append(f"floating base: body '{body.name}' moves freely")
    elif base == "fixed":
        for body in roots:
            for joint in free[body.name]:
                spec.delete(joint)
                notes.append(f"fixed base: body '{body.name}' is welded to the world")
    if notes and list(spec.keys):
        for key in list(spec.keys):
            spec.delete(key)
        notes.append("keyframes dropped: they do not fit the changed base")
    return notes


def _moves(body: Any) -> bool:
    """Whether a root body is more than scenery: it has mass, or joints below it."""
    return bool(body.explicitinertial or body.geoms or any(b.joints for b in body.find_all("body")))
