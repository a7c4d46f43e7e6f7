"""Make a model independent of files: drop what is only looked at, note what is missing."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from trajopt.errors import ModelError, ModelWarning
from trajopt.models.messages import listing

if TYPE_CHECKING:
    from trajopt.models.source import Source

__all__ = ["drop_files"]


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
    _weigh_as_written(source)
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


def _weigh_as_written(source: Source) -> None:
    """Let links of a URDF without an inertial element weigh nothing, as the format has it.

    MuJoCo would give them the mass of their collision geometry, filled with water.
    """
    for geom in source.spec.geoms if source.urdf else []:
        if not geom.parent.explicitinertial:
            geom.mass = 0.0


def _drop_unused_meshes(source: Source) -> None:
    used = {geom.meshname for geom in source.spec.geoms}
    for mesh in list(source.spec.meshes):
        if mesh.name not in used:
            source.spec.delete(mesh)
