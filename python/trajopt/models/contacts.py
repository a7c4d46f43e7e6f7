"""Choose which geoms touch the world and each other, and place their points on the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import rotations
from trajopt.models import geometry
from trajopt.rigid import apply, compose, rigid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trajopt.models.tree import Tree

__all__ = ["Spheres", "contact_points", "ground", "scenery", "self_collision", "sphere_pairs"]


@dataclass
class Spheres:
    """Spheres fixed to joints; ``body`` and ``geom`` are MuJoCo's indices."""

    joint: list[int] = field(default_factory=list)
    position: list[NDArray[Any]] = field(default_factory=list)
    radius: list[float] = field(default_factory=list)
    body: list[int] = field(default_factory=list)
    geom: list[int] = field(default_factory=list)

    def add(self, m: Any, tree: Tree, geom: int, centres: NDArray[Any], radius: float) -> None:
        """Append spheres given in the frame of a geom."""
        body = int(m.geom_bodyid[geom])
        joint, frame = tree.attachment[body]
        rotation = rotations.matrix_from_quaternion(m.geom_quat[geom])
        frame = compose(frame, rigid(m.geom_pos[geom], rotation))
        for centre in apply(frame, centres):
            self.joint.append(joint)
            self.position.append(centre)
            self.radius.append(radius)
            self.body.append(body)
            self.geom.append(geom)


def _moving(m: Any, geom: int) -> bool:
    return bool(m.body_weldid[m.geom_bodyid[geom]] != 0)


def _filtered(m: Any, a: int, b: int) -> bool:
    """Whether MuJoCo's masks let two geoms touch."""
    return bool(
        m.geom_contype[a] & m.geom_conaffinity[b] or m.geom_contype[b] & m.geom_conaffinity[a]
    )


def _pairs(m: Any) -> list[tuple[int, int]]:
    return [(int(m.pair_geom1[i]), int(m.pair_geom2[i])) for i in range(m.npair)]


def _planes(m: Any) -> list[int]:
    return [g for g in range(m.ngeom) if m.geom_type[g] == geometry.PLANE and not _moving(m, g)]


def ground(m: Any) -> tuple[NDArray[Any], float] | None:
    """Plane n·p = h of the first plane of the world body.

    Parameters
    ----------
    m : mujoco.MjModel

    Returns
    -------
    tuple of (ndarray (3,), float) or None
        Unit normal and offset [m]; None without a plane.
    """
    for geom in _planes(m):
        body = int(m.geom_bodyid[geom])
        frame = rigid(m.geom_pos[geom], rotations.matrix_from_quaternion(m.geom_quat[geom]))
        while body > 0:
            rotation = rotations.matrix_from_quaternion(m.body_quat[body])
            frame = compose(rigid(m.body_pos[body], rotation), frame)
            body = int(m.body_parentid[body])
        normal = frame[:, 2]
        return normal, float(normal @ frame[:, 3])
    return None


def scenery(m: Any) -> list[str]:
    """Names of solid geoms of the world other than the first plane; they are left out."""
    planes = _planes(m)[:1]
    # The fixed base of a robot is not scenery: something that moves hangs on it.
    bases = set()
    for moving in np.flatnonzero(m.body_weldid != 0):
        body = int(moving)
        while body > 0:
            body = int(m.body_parentid[body])
            bases.add(body)
    bases.discard(0)
    solid = [
        g
        for g in range(m.ngeom)
        if not _moving(m, g)
        and (m.geom_contype[g] or m.geom_conaffinity[g])
        and g not in planes
        and int(m.geom_bodyid[g]) not in bases
    ]
    return [f"{m.geom(g).name or g} ({geometry.kind_name(m, g)})" for g in solid]


def contact_points(m: Any, tree: Tree) -> tuple[Spheres, list[str]]:
    """Points with which moving bodies touch the world.

    A geom takes part if MuJoCo's masks (``contype``, ``conaffinity``) let it touch the plane of
    the file, or, without a plane, if either mask is not zero; or if a ``<pair>`` says so.

    Parameters
    ----------
    m : mujoco.MjModel
    tree : Tree

    Returns
    -------
    points : Spheres
    unknown : list of str
        Geoms of types that have no contact points.
    """
    points, unknown = Spheres(), []
    planes = _planes(m)[:1]
    paired = {g for pair in _pairs(m) if not all(_moving(m, g) for g in pair) for g in pair}
    for geom in range(m.ngeom):
        if not _moving(m, geom):
            continue
        solid = bool(m.geom_contype[geom] or m.geom_conaffinity[geom])
        if planes:
            solid = _filtered(m, geom, planes[0])
        if not (solid or geom in paired):
            continue
        found = geometry.contact_points(m, geom)
        if found is None:
            unknown.append(f"{m.geom(geom).name or geom} ({geometry.kind_name(m, geom)})")
        else:
            points.add(m, tree, geom, *found)
    return points, unknown


def self_collision(m: Any, tree: Tree) -> Spheres:
    """Spheres that fill the solid geoms of moving bodies."""
    out = Spheres()
    paired = {g for pair in _pairs(m) for g in pair}
    for geom in range(m.ngeom):
        solid = m.geom_contype[geom] or m.geom_conaffinity[geom] or geom in paired
        if _moving(m, geom) and solid and geometry.contact_points(m, geom) is not None:
            out.add(m, tree, geom, *geometry.spheres(m, geom))
    return out


def sphere_pairs(m: Any, balls: Spheres, centres: NDArray[Any]) -> NDArray[np.int32]:
    """Pairs of spheres that may collide.

    Left out are pairs of one body or of neighbours in the tree, those that masks or ``<exclude>``
    rule out, and those that overlap in the home pose already.

    Parameters
    ----------
    m : mujoco.MjModel
    balls : Spheres
    centres : ndarray, shape (S, 3)
        World positions in the home pose.

    Returns
    -------
    ndarray of int32, shape (Q, 2)
    """
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in m.exclude_signature}
    paired = {frozenset(pair) for pair in _pairs(m)}
    weld = m.body_weldid
    allowed: dict[tuple[int, int], bool] = {}

    def may_touch(a: int, b: int) -> bool:
        body_a, body_b = int(m.geom_bodyid[a]), int(m.geom_bodyid[b])
        root_a, root_b = int(weld[body_a]), int(weld[body_b])
        if root_a == root_b:
            return False
        if frozenset((a, b)) in paired:
            return True
        near = weld[m.body_parentid[root_a]] == root_b or weld[m.body_parentid[root_b]] == root_a
        if near or (body_a, body_b) in excluded or (body_b, body_a) in excluded:
            return False
        return _filtered(m, a, b)

    out = []
    for i in range(len(balls.geom)):
        for k in range(i + 1, len(balls.geom)):
            key = (balls.geom[i], balls.geom[k])
            if key not in allowed:
                allowed[key] = may_touch(*key)
            if not allowed[key]:
                continue
            gap = float(np.linalg.norm(centres[i] - centres[k])) - balls.radius[i] - balls.radius[k]
            if gap > 0:
                out.append((i, k))
    return np.array(out, dtype=np.int32).reshape(-1, 2)
