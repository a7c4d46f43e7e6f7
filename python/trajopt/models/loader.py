"""Load a character or robot: MJCF, URDF or built-in.

Everything passes through MuJoCo's own compiler, so what MuJoCo reads, trajopt reads.
"""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from trajopt.errors import ArgumentError, ModelWarning
from trajopt.model import Model
from trajopt.models import contacts, represent
from trajopt.models.assets import drop_files
from trajopt.models.base import set_base
from trajopt.models.canonical import canonical_xml
from trajopt.models.home import home_pose
from trajopt.models.inertia import pseudo_inertia
from trajopt.models.messages import listing
from trajopt.models.prepare import compile_spec, free_mimics, repair_inertias
from trajopt.models.source import read
from trajopt.models.tree import build_tree

if TYPE_CHECKING:
    from trajopt.models.contacts import Spheres
    from trajopt.models.source import Source
    from trajopt.models.tree import Tree

__all__ = ["load_model"]

Base = Literal["auto", "floating", "fixed"]
Actuated = Literal["auto", "joints", "actuators"]


def load_model(
    path_or_name: str | os.PathLike[str],
    base: Base = "auto",
    actuated: Actuated = "auto",
) -> Model:
    """Load a model from an MJCF or URDF file, or a built-in character.

    Parameters
    ----------
    path_or_name : str or path
        A ``.xml`` (MJCF) or ``.urdf`` file, or a built-in name: ``chain``, ``biped``, ``bird``,
        ``mammal``, ``spider``, ``humanoid``.
    base : {"auto", "floating", "fixed"}
        Whether the root body moves freely.  "auto" takes an MJCF file at its word; the root of a
        URDF, which has no word for it, floats unless its root link is called ``world``.
    actuated : {"auto", "joints", "actuators"}
        Which dofs have a motor.  "joints": all but those of free joints.  "actuators": those that
        the file's actuators act on.  "auto": the latter if the file has actuators, else the former.

    Returns
    -------
    Model

    Raises
    ------
    ModelError
        If the file is missing or malformed, nothing in it has mass, or it holds something that
        changes the motion and cannot be represented (equality constraints, closed loops, tendons
        with limits or springs, flexible bodies); the message names the element.
    ArgumentError, ArgumentTypeError
        If an argument is not one of the values above.

    Warns
    -----
    ModelWarning
        One line each for missing mesh files, for what was ignored because trajectories do not
        depend on it (sensors, gains, joint damping, ...), for solid scenery other than a plane, and
        for a model without collision geometry.

    Examples
    --------
    >>> model = load_model("mammal")
    >>> model.ndof, model.nactuated, len(model.feet)
    (18, 12, 4)
    """
    for argument, value, known in (
        ("base", base, get_args(Base)),
        ("actuated", actuated, get_args(Actuated)),
    ):
        if value not in known:
            raise ArgumentError(f"{argument} must be one of {', '.join(known)}, not {value!r}")
    source = read(path_or_name)
    drop_files(source)
    repair_inertias(source)
    free_mimics(source)
    notes = set_base(source, base)
    m = compile_spec(source)
    represent.refuse(m, source.label)
    tree = build_tree(m)
    mask, passive = represent.actuated_dofs(m, source.label, actuated)
    points, unknown = contacts.contact_points(m, tree)
    _warn(source, m, tree, points, unknown)
    return _assemble(source, m, tree, mask, points, notes + passive)


def _warn(source: Source, m: Any, tree: Tree, points: Spheres, unknown: list[str]) -> None:
    """One line a subject."""

    def warn(text: str) -> None:
        warnings.warn(f"{source.label}: {text}", ModelWarning, stacklevel=4)

    ignored = represent.ignored(m, tree.limited_balls)
    if ignored:
        warn("ignored: " + "; ".join(ignored))
    scenery = contacts.scenery(m)
    if scenery:
        warn(f"scenery left out, the world is given by World: geoms {listing(scenery)}")
    if unknown:
        warn(f"geoms of this type touch nothing: {listing(unknown)}")
    if not points.joint:
        warn("no collision geometry: the model touches nothing")


def _assemble(
    source: Source, m: Any, tree: Tree, mask: Any, points: Spheres, notes: list[str]
) -> Model:
    index = {body: k for k, body in enumerate(tree.body_id)}
    balls = contacts.self_collision(m, tree)
    plane = contacts.ground(m)
    if plane is not None:
        notes = [*notes, f"ground plane of the file at height {plane[1]:g} m"]
    model = Model(
        name=source.name,
        xml="",
        joint_names=tuple(tree.joint_name),
        joint_type=np.array(tree.joint_type, dtype=np.int32),
        joint_parent=np.array(tree.joint_parent, dtype=np.int32),
        joint_offset=np.array(tree.joint_offset),
        joint_axis=np.array(tree.joint_axis),
        dof_names=tuple(tree.dof_name),
        lower=np.array(tree.lower),
        upper=np.array(tree.upper),
        actuated=mask,
        home=np.zeros(m.nv),
        body_names=tuple(tree.body_name),
        body_joint=np.array(tree.body_joint, dtype=np.int32),
        body_offset=np.array(tree.body_offset),
        pseudo_inertia=np.array([pseudo_inertia(m, body) for body in tree.body_id]),
        point_body=np.array([index[body] for body in points.body], dtype=np.int32),
        point_position=np.array(points.position).reshape(-1, 3),
        point_radius=np.array(points.radius),
        sphere_body=np.array([index[body] for body in balls.body], dtype=np.int32),
        sphere_position=np.array(balls.position).reshape(-1, 3),
        sphere_radius=np.array(balls.radius),
        sphere_pairs=np.zeros((0, 2), dtype=np.int32),
        leg_length=_numeric(m, "leg_length"),
        ground=None if plane is None else (*(float(v) for v in plane[0]), plane[1]),
        notes=tuple(notes),
    )
    model = model.replace(home=home_pose(m, model, settle=source.urdf))
    pairs = contacts.sphere_pairs(m, balls, model.sphere_centers(model.home))
    return model.replace(sphere_pairs=pairs, xml=canonical_xml(source.spec, m))


def _numeric(m: Any, name: str) -> float | None:
    """First number of a ``<custom><numeric>`` element, None if there is none."""
    for i in range(m.nnumeric):
        if m.numeric(i).name == name:
            return float(m.numeric_data[m.numeric_adr[i]])
    return None
