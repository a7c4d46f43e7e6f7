"""Random kinematic trees in the form of `Model.core_arguments()`: no model file, no loader."""

from __future__ import annotations

from typing import Any

import numpy as np

from .reference import BALL, HINGE, SLIDE


def random_rotation(rng: np.random.Generator) -> Any:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q


def random_tree(seed: int, joints: int = 7, floating: bool = True) -> dict[str, Any]:
    """A branching tree with every joint type, massless links, contact points and spheres."""
    rng = np.random.default_rng(seed)
    kinds = [SLIDE, SLIDE, SLIDE, BALL] if floating else [HINGE]
    parents = [-1, 0, 1, 2] if floating else [-1]
    while len(kinds) < joints:
        kinds.append(int(rng.choice([SLIDE, HINGE, HINGE, BALL])))
        parents.append(int(rng.integers(3 if floating else 0, len(kinds) - 1)))
    count = len(kinds)
    offset = np.zeros((count, 3, 4))
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    inertia = np.zeros((count, 4, 4))
    for j in range(count):
        offset[j, :, :3] = random_rotation(rng)
        offset[j, :, 3] = 0.3 * rng.normal(size=3)
        cloud = np.concatenate([0.2 * rng.normal(size=(5, 3)), np.ones((5, 1))], axis=1)
        # The last joint always has mass, as a massless tip would make the system singular.
        if j == count - 1 or rng.random() > 0.2:
            inertia[j] = 0.1 * cloud.T @ cloud
    if floating:
        offset[:4] = np.concatenate([np.eye(3), np.zeros((3, 1))], axis=1)
        axis[:3] = np.eye(3)
        inertia[:3] = 0.0
    ndof = sum(3 if k == BALL else 1 for k in kinds)
    free = 6 if floating else 0
    lower, upper = np.full(ndof, -np.inf), np.full(ndof, np.inf)
    start = 0
    for kind in kinds:
        if kind == HINGE:
            lower[start], upper[start] = -0.3, 0.4
        start += 3 if kind == BALL else 1
    pairs = [[0, 1], [1, 2]]
    return {
        "joint_type": np.array(kinds, dtype=np.int32),
        "joint_parent": np.array(parents, dtype=np.int32),
        "joint_offset": offset,
        "joint_axis": axis,
        "link_inertia": inertia,
        "lower": lower,
        "upper": upper,
        "actuated": np.arange(ndof) >= free,
        "point_joint": np.sort(rng.integers(free and 3, count, size=6)).astype(np.int32),
        "point_position": 0.2 * rng.normal(size=(6, 3)),
        "point_radius": rng.uniform(0.0, 0.1, size=6),
        "sphere_joint": np.array([count - 1, count - 2, free and 3], dtype=np.int32),
        "sphere_position": 0.1 * rng.normal(size=(3, 3)),
        "sphere_radius": np.array([0.4, 0.5, 0.3]),
        "sphere_pairs": np.array(pairs, dtype=np.int32),
    }


def random_frames(seed: int, ndof: int, count: int, spread: float = 0.6) -> list[Any]:
    """Three neighbouring frames (count, D) each, up to a few steps of fast motion apart."""
    rng = np.random.default_rng(seed)
    middle = spread * rng.normal(size=(count, ndof))
    return [middle + 0.05 * rng.normal(size=(count, ndof)) for _ in range(3)]
