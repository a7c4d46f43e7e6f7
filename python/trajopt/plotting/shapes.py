"""What to draw of a body: convex hulls of points with a radius, taken from the model's geoms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.models.coordinates import to_qpos

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Puppet", "outline"]

FloatArray = NDArray[np.float64]

CIRCLE = np.stack([np.cos(a := np.linspace(0, 2 * np.pi, 32, endpoint=False)), np.sin(a)], axis=1)
CUBE = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=np.float64)


@dataclass(frozen=True)
class Shape:
    """The convex hull of balls of one `radius` [m] about `points` (n, 3) in the frame of a geom."""

    geom: int
    points: FloatArray
    radius: float


class Puppet:
    """Places the shapes of a model in the world.

    Parameters
    ----------
    model : Model
        Character whose geoms are drawn.
    """

    def __init__(self, model: Model) -> None:
        import mujoco

        self._mujoco = mujoco
        self._m = mujoco.MjModel.from_xml_string(model.xml)
        self._data = mujoco.MjData(self._m)
        geoms = range(self._m.ngeom)
        shapes = (_shape(self._m, g) for g in geoms if self._m.geom_bodyid[g] > 0)
        self._shapes = [shape for shape in shapes if shape is not None]
        self._shapes += _bones(self._m, self._shapes)

    def place(self, x: ArrayLike) -> list[tuple[FloatArray, float]]:
        """Return points (n, 3) [m] and radius [m] of every shape at the coordinates `x` (D,)."""
        data = self._data
        data.qpos[:] = to_qpos(self._m, x)
        self._mujoco.mj_kinematics(self._m, data)
        placed = []
        for shape in self._shapes:
            if shape.geom >= 0:
                rotation = data.geom_xmat[shape.geom].reshape(3, 3)
                origin = data.geom_xpos[shape.geom]
            else:  # a bone hangs on a body
                body = -shape.geom
                rotation, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
            placed.append((shape.points @ rotation.T + origin, shape.radius))
        return placed


def outline(points: FloatArray, radius: float) -> FloatArray:
    """Return the polygon around discs of one radius: the silhouette of a shape.

    Parameters
    ----------
    points : (n, 2) array
        Centers of the discs [m].
    radius : float
        Their radius [m].

    Returns
    -------
    (m, 2) array
        Corners in counterclockwise order.

    Examples
    --------
    >>> box = outline(np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]), 0.0)
    >>> len(box)
    4
    """
    dilated = (points[:, None, :] + radius * CIRCLE).reshape(-1, 2) if radius > 0 else points
    ordered = dilated[np.lexsort((dilated[:, 1], dilated[:, 0]))]
    return np.array(_chain(ordered)[:-1] + _chain(ordered[::-1])[:-1])


def _chain(points: FloatArray) -> list[FloatArray]:
    """Return the lower hull of points sorted along x (Andrew's monotone chain)."""
    chain: list[FloatArray] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _shape(m: Any, geom: int) -> Shape | None:
    """Return the shape of a geom; None for one that is transparent or endless."""
    import mujoco

    kind, size = mujoco.mjtGeom(m.geom_type[geom]), m.geom_size[geom]
    if m.geom_rgba[geom, 3] == 0:
        return None
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return Shape(geom, np.zeros((1, 3)), float(size[0]))
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return Shape(geom, np.array([[0, 0, -size[1]], [0, 0, size[1]]]), float(size[0]))
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return Shape(geom, CUBE * size, 0.0)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        ends = [np.column_stack([size[0] * CIRCLE, np.full(32, h)]) for h in (-size[1], size[1])]
        return Shape(geom, np.concatenate(ends), 0.0)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        rings = [
            np.column_stack([np.sin(t) * CIRCLE, np.full(32, np.cos(t))])
            for t in np.linspace(0, np.pi, 13)
        ]
        return Shape(geom, np.concatenate(rings) * size, 0.0)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = m.geom_dataid[geom]
        first = m.mesh_vertadr[mesh]
        vertices = m.mesh_vert[first : first + m.mesh_vertnum[mesh]]
        return Shape(geom, np.asarray(vertices, dtype=np.float64), 0.0)
    return None


def _bones(m: Any, shapes: list[Shape]) -> list[Shape]:
    """Return sticks that join what hangs in the air: shapes off their joint, bodies without one."""
    reach = float(np.abs(m.body_pos).max(initial=0.0)) or 0.1
    drawn = {int(m.geom_bodyid[shape.geom]) for shape in shapes}
    bones = [
        Shape(-int(m.body_parentid[b]), np.array([np.zeros(3), m.body_pos[b]]), 0.04 * reach)
        for b in range(1, m.nbody)
        if m.body_parentid[b] > 0 and int(m.body_parentid[b]) not in drawn
    ]
    for shape in shapes:
        center = np.array(m.geom_pos[shape.geom])
        ball = len(shape.points) == 1
        if ball and np.linalg.norm(center) > shape.radius:
            body = int(m.geom_bodyid[shape.geom])
            bones.append(Shape(-body, np.array([np.zeros(3), center]), 0.4 * shape.radius))
    if bones or shapes:
        return bones
    return [Shape(-b, np.zeros((1, 3)), 0.3 * reach) for b in range(1, m.nbody)]
