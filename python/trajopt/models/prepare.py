"""Edit what was read so that it compiles without outside files, and compile it."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import ModelError, ModelWarning
from trajopt.models.source import one_line

if TYPE_CHECKING:
    from trajopt.models.source import Source

__all__ = ["MASSLESS", "compile_spec", "drop_files", "listing", "set_base"]

# MuJoCo wants mass on every body with a joint; links without any get this and are zeroed later.
MASSLESS = 1e-12


def listing(names: list[str], limit: int = 4) -> str:
    """Names separated by commas, the tail counted rather than named.

    Examples
    --------
    >>> listing(["a", "b", "c"], limit=2)
    'a, b and 1 more'
    """
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit} more"


def drop_files(source: Source) -> None:
    """Remove all that refers to files but is not needed: textures, skins, meshes only seen.

    Raises
    ------
    ModelError
        If a body takes its inertia from a mesh whose file is missing.

    Warns
    -----
    ModelWarning
        Once, if mesh files are missing.
    """
    import mujoco

    spec = source.spec
    for texture in spec.textures:
        if texture.file or any(texture.cubefiles):
            texture.file = ""
            texture.cubefiles = [""] * len(texture.cubefiles)
            texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_FLAT
            cube = texture.type != mujoco.mjtTexture.mjTEXTURE_2D
            texture.width, texture.height = 1, 6 if cube else 1
    for skin in list(spec.skins):
        spec.delete(skin)
    from_geom = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    weighed = set()
    for geom in list(spec.geoms):
        mesh, body = geom.meshname, geom.parent
        if not mesh:
            continue
        weighs = body != spec.worldbody and (from_geom or not body.explicitinertial)
        weighs = weighs and geom.mass != 0 and geom.density != 0
        if mesh in source.missing:
            if weighs:
                raise ModelError(
                    f"{source.label}: body '{body.name}' has no inertial element and takes its mass"
                    f" from mesh '{mesh}', whose file cannot be used: {source.missing[mesh]}"
                )
            spec.delete(geom)
        elif not weighs and geom.contype == 0 and geom.conaffinity == 0 and not spec.pairs:
            spec.delete(geom)
        elif weighs:
            weighed.add(mesh)
    _drop_unused_meshes(source)
    for mesh in spec.meshes:
        # Of the others only the shape counts, so an open or flat one need not be refused.
        if mesh.name not in weighed:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    if source.missing:
        reasons = listing(sorted(set(source.missing.values())), 3)
        warnings.warn(
            f"{source.label}: mesh files left out, inertias come from the model file: {reasons}",
            ModelWarning,
            stacklevel=3,
        )


def _drop_unused_meshes(source: Source) -> None:
    used = {geom.meshname for geom in source.spec.geoms}
    for mesh in list(source.spec.meshes):
        if mesh.name not in used:
            source.spec.delete(mesh)


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
        # MuJoCo merges a root link called "world" into the world, so the next ones have joints.
        base = "floating" if source.urdf and not any(list(b.joints) for b in roots) else ""
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
    return bool(
        body.explicitinertial or body.geoms or any(b.joints for b in body.find_all("body"))
    )


def compile_spec(source: Source) -> Any:
    """Compile, allowing massless links and repairing inertias that no body can have.

    Returns
    -------
    mujoco.MjModel

    Raises
    ------
    ModelError
        With the compiler's message on one line.

    Warns
    -----
    ModelWarning
        If principal moments of inertia violate A + B >= C and were balanced.
    """
    spec = source.spec
    spec.compiler.fusestatic = False  # merging is done on joints, and names stay
    spec.compiler.boundmass = max(spec.compiler.boundmass, MASSLESS)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, MASSLESS)
    try:
        return _compiled(spec)
    except (ValueError, RuntimeError) as error:
        message = one_line(error)
        if "balanceinertia" not in message:
            raise ModelError(f"{source.label}: {message}") from error
    spec.compiler.balanceinertia = True
    warnings.warn(
        f"{source.label}: some principal moments of inertia violate A + B >= C, which no body"
        f" can have; their mean is used instead ({message})",
        ModelWarning,
        stacklevel=3,
    )
    try:
        return _compiled(spec)
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{source.label}: {one_line(error)}") from error


def _compiled(spec: Any) -> Any:
    m = spec.compile()
    massless = m.body_mass <= 2 * MASSLESS
    m.body_mass[massless] = 0.0
    m.body_inertia[massless] = 0.0
    if not np.isfinite(m.body_mass).all() or not np.isfinite(m.body_inertia).all():
        raise ValueError("masses and inertias must be finite numbers")
    return m
