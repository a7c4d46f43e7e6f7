"""One MJCF text that stands for a loaded model without any other file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import rotations
from trajopt.models.geometry import hull_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["canonical_xml"]


def canonical_xml(spec: Any, m: Any) -> str:
    """MJCF text of a compiled specification: inertias explicit, meshes as convex hulls in line.

    Parameters
    ----------
    spec : mujoco.MjSpec
        The specification ``m`` was compiled from; it is changed.
    m : mujoco.MjModel

    Returns
    -------
    str
    """
    import mujoco

    for body in spec.bodies:
        i = body.id
        if i == 0:
            continue
        body.explicitinertial = True
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]  # NaN: not given, the diagonal one counts
        # Massless links need a trace of mass again to compile.
        body.mass = max(float(m.body_mass[i]), spec.compiler.boundmass)
        body.inertia = np.maximum(_roundable(m.body_inertia[i]), spec.compiler.boundinertia)
        body.ipos, body.iquat = m.body_ipos[i], m.body_iquat[i]
        body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    spec.compiler.settotalmass = -1
    for mesh in list(spec.meshes):
        i = mesh.id
        # Compiling moved the vertices into the mesh's inertial frame; the file's frame is wanted.
        back = rotations.matrix_from_quaternion(m.mesh_quat[i])
        vertices = hull_vertices(m, i, limit=256) @ back.T + m.mesh_pos[i]
        # A new mesh, because one read from a file keeps the faces and normals of that file.
        hull = spec.add_mesh(name=f"{mesh.name}_hull", uservert=vertices.ravel())
        hull.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        for geom in spec.geoms:
            if geom.meshname == mesh.name:
                geom.meshname = hull.name
        spec.delete(mesh)
    spec.meshdir = spec.texturedir = ""
    return str(spec.to_xml())


def _roundable(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Principal moments that satisfy A + B >= C even after rounding to the text's six digits."""
    total = float(moments.sum())
    second = np.maximum(0.5 * total - moments, 2e-6 * total)
    return np.asarray(second.sum() - second)
