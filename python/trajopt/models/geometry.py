"""What bodies touch with: contact points for obstacles, spheres for self collision.

Contact points are spheres (points where the radius is 0) fixed to a body:

========== ==========================================================================
sphere     its centre, with its radius
capsule    the two end spheres
box        the 8 corners
cylinder   8 points on each rim
ellipsoid  the 6 ends of its axes
mesh       vertices of its convex hull; of more than 32 those that are extreme along 32
           directions spread evenly
========== ==========================================================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["PLANE", "contact_points", "hull_vertices", "kind_name", "spheres"]

PLANE, _HFIELD, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = range(8)
_NAMES = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")

RIM_POINTS = 8
MAX_HULL_POINTS = 32
MAX_SPHERES = 3

_CORNERS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)


def kind_name(m: Any, geom: int) -> str:
    """Name of the type of a geom."""
    kind = int(m.geom_type[geom])
    return _NAMES[kind] if kind < len(_NAMES) else f"type {kind}"


def contact_points(m: Any, geom: int) -> tuple[NDArray[Any], float] | None:
    """Contact spheres of a geom in the geom's own frame.

    Parameters
    ----------
    m : mujoco.MjModel
    geom : int
        Index of the geom.

    Returns
    -------
    tuple of (ndarray (n, 3), float) or None
        Centres and their common radius [m]; None for a type that cannot be represented.
    """
    kind = int(m.geom_type[geom])
    size = m.geom_size[geom]
    if kind == _SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == _CAPSULE:
        return np.array([[0, 0, -size[1]], [0, 0, size[1]]]), float(size[0])
    if kind == _BOX:
        return _CORNERS * size, 0.0
    if kind == _CYLINDER:
        angle = 2 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
        rim = np.stack([size[0] * np.cos(angle), size[0] * np.sin(angle), 0 * angle], axis=1)
        return np.concatenate([rim - [0, 0, size[1]], rim + [0, 0, size[1]]]), 0.0
    if kind == _ELLIPSOID:
        return np.concatenate([np.diag(size), -np.diag(size)]), 0.0
    if kind == _MESH:
        return hull_vertices(m, int(m.geom_dataid[geom])), 0.0
    return None


def hull_vertices(m: Any, mesh: int, limit: int = MAX_HULL_POINTS) -> NDArray[Any]:
    """Vertices of the convex hull of a mesh, in the frame of the geoms that show it.

    Parameters
    ----------
    m : mujoco.MjModel
    mesh : int
        Index of the mesh.
    limit : int
        Largest number of vertices to return.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    start = m.mesh_vertadr[mesh]
    vertices = np.asarray(m.mesh_vert[start : start + m.mesh_vertnum[mesh]], dtype=np.float64)
    try:
        vertices = vertices[np.sort(ConvexHull(vertices).vertices)]
    except QhullError:  # a flat mesh has no hull of its own: all of its vertices stand
        vertices = np.unique(vertices, axis=0)
    if len(vertices) <= limit:
        return vertices
    # Fibonacci sphere: directions of nearly equal spacing, the same on every machine.
    i = np.arange(limit)
    z = 1 - (2 * i + 1) / limit
    phi = i * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - z * z)
    directions = np.stack([ring * np.cos(phi), ring * np.sin(phi), z], axis=1)
    return np.asarray(vertices[np.unique(np.argmax(directions @ vertices.T, axis=1))])


def spheres(m: Any, geom: int) -> tuple[NDArray[Any], float]:
    """At most three equal spheres along the longest axis of a geom, for self collision.

    A sphere is itself and a capsule is filled from end to end.  Other shapes are treated as the
    capsule inside their bounding box whose radius is the mean of the two smaller half sizes.

    Parameters
    ----------
    m : mujoco.MjModel
    geom : int

    Returns
    -------
    centres : ndarray, shape (n, 3)
        In the geom's own frame [m].
    radius : float
    """
    kind = int(m.geom_type[geom])
    size = m.geom_size[geom]
    if kind == _SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind in (_CAPSULE, _CYLINDER):
        radius = float(size[0])
        half = float(size[1]) if kind == _CAPSULE else max(float(size[1]) - radius, 0.0)
        return _row(np.array([0.0, 0.0, half]), radius), radius
    centre, extent = m.geom_aabb[geom, :3], m.geom_aabb[geom, 3:]
    order = np.argsort(extent)
    radius = float(extent[order[:2]].mean())
    reach = np.zeros(3)
    reach[order[2]] = max(float(extent[order[2]]) - radius, 0.0)
    return centre + _row(reach, radius), radius


def _row(reach: NDArray[Any], radius: float) -> NDArray[Any]:
    """Centres from -reach to +reach, a radius apart unless that takes more than three."""
    length = 2 * float(np.linalg.norm(reach))
    if length < 1e-9:
        return np.zeros((1, 3))
    count = min(MAX_SPHERES, int(np.ceil(length / radius)) + 1)
    return np.asarray(np.linspace(-1, 1, count)[:, None] * reach)
