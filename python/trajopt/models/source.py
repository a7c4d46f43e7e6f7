"""Find a model file, read it, and put every file it refers to where the compiler looks for it."""

from __future__ import annotations

import os
import re
import warnings
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from trajopt.errors import ArgumentTypeError, ModelError
from trajopt.models.messages import one_line

__all__ = ["Source", "builtin_names", "builtin_path", "read"]

_CHARACTERS = Path(__file__).parent / "characters"
_MESH_FORMATS = (".stl", ".obj", ".msh")


@dataclass
class Source:
    """A model file that was read but not compiled.

    Attributes
    ----------
    label : str
        What messages call it: the file's name, or the built-in's.
    name : str
        Name of the model.
    urdf : bool
        Whether the file is URDF rather than MJCF.
    grounded : bool
        Whether it is a URDF whose root link is called ``world``.
    spec : mujoco.MjSpec
        Its editable content.
    missing : dict of str to str
        Mesh assets without a usable file, and what is wrong with it.
    """

    label: str
    name: str
    urdf: bool
    grounded: bool
    spec: Any
    missing: dict[str, str] = field(default_factory=dict)


def builtin_names() -> tuple[str, ...]:
    """Names of the characters that come with the package.

    Examples
    --------
    >>> "mammal" in builtin_names()
    True
    """
    return tuple(sorted(path.stem for path in _CHARACTERS.glob("*.xml")))


def builtin_path(name: str) -> Path:
    """Path of the MJCF file of a built-in character."""
    return _CHARACTERS / f"{name}.xml"


def read(path_or_name: str | os.PathLike[str]) -> Source:
    """Read a model file or a built-in character.

    Parameters
    ----------
    path_or_name : str or path
        A ``.xml`` (MJCF) or ``.urdf`` file, or the name of a built-in character.

    Returns
    -------
    Source

    Raises
    ------
    ArgumentTypeError
        If it is neither a string nor a path.
    ModelError
        If there is no such file, or it is not well-formed.
    """
    import mujoco

    if not isinstance(path_or_name, (str, os.PathLike)):
        kind = type(path_or_name).__name__
        raise ArgumentTypeError(f"path_or_name must be a string or a path, not {kind}")
    path, builtin = _locate(os.fspath(path_or_name))
    root = _root(path)
    try:
        with warnings.catch_warnings():
            # MuJoCo's notices about old attributes are for the author of the file.
            warnings.simplefilter("ignore", UserWarning)
            spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{path.name}: {one_line(error)}") from error
    own = root.get("name") if root.tag == "robot" else root.get("model")
    source = Source(
        label=builtin or path.name,
        name=builtin or own or path.stem,
        urdf=root.tag == "robot",
        grounded="world" in _root_links(root),
        spec=spec,
    )
    _resolve_meshes(source, path.resolve().parent)
    return source


def _locate(text: str) -> tuple[Path, str]:
    """Path of the file, and the built-in's name if it is one."""
    path = Path(text)
    if path.is_file():
        return path, ""
    if text in builtin_names():
        return builtin_path(text), text
    if path.is_dir():
        raise ModelError(f"model '{text}' is a folder; give the .xml or .urdf file in it")
    if path.suffix or len(path.parts) > 1:
        raise ModelError(f"{text}: no such file")
    known = ", ".join(builtin_names())
    raise ModelError(f"no built-in model is named '{text}'; known: {known}; or give a file")


def _root(path: Path) -> ET.Element:
    """Root element, after checks whose messages are clearer than the compiler's."""
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError as error:
        raise ModelError(f"{path.name}: not well-formed XML: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ModelError(f"{path.name}: cannot be read: {error}") from error
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise ModelError(f"{path.name}: holds xacro macros; expand them first: xacro in > out.urdf")
    if root.tag not in ("mujoco", "robot"):
        raise ModelError(
            f"{path.name}: root element is <{root.tag}>; expected <mujoco> (MJCF) or <robot> (URDF)"
        )
    for element in root.iter():
        for attribute, text in element.attrib.items():
            # Before the compiler sees it: MuJoCo writes about NaN to a log file and goes on.
            if {"nan", "+nan", "-nan"} & set(text.lower().split()):
                raise ModelError(f"{path.name}: {attribute}='{text}' of <{element.tag}> holds NaN")
    return root


def _root_links(robot: ET.Element) -> set[str]:
    """Names of the links of a URDF that no joint moves."""
    children = {str(child.get("link")) for child in robot.iterfind("joint/child")}
    return {str(link.get("name")) for link in robot.iterfind("link")} - children


def _resolve_meshes(source: Source, folder: Path) -> None:
    """Point mesh assets at files that exist; note the others in ``source.missing``."""
    spec = source.spec
    for mesh in spec.meshes:
        if not mesh.file:
            continue  # vertices stand in the model file itself
        found = _find(mesh.file, folder, spec.meshdir)
        if found is None:
            source.missing[mesh.name] = f"{mesh.file} not found"
        elif found.suffix.lower() not in _MESH_FORMATS:
            source.missing[mesh.name] = f"{mesh.file} is not STL, OBJ or MSH"
        elif found.suffix.lower() == ".stl" and not _is_binary_stl(found):
            source.missing[mesh.name] = f"{mesh.file} is not a binary STL of 1 to 200000 faces"
        else:
            mesh.file = str(found)
    spec.strippath = False


def _find(file: str, folder: Path, meshdir: str) -> Path | None:
    """Look for a mesh where MuJoCo does, then where ROS packages usually lie."""
    match = re.match(r"^(package|model|file)://(.*)$", file)
    scheme, rest = (match[1], match[2]) if match else ("", file)
    candidates = [folder / meshdir / rest, folder / rest]
    if scheme == "file":
        candidates.insert(0, Path(rest))
    if scheme in ("package", "model"):
        rest = rest.lstrip("/")  # package:///name/... is common, and read as package://name/...
        package, _, inner = rest.partition("/")
        for parent in (folder, *folder.parents):
            candidates.append(parent / rest)
            # The package's folder need not bear its name: it is the one with package.xml.
            if (parent / "package.xml").is_file() or parent.name == package:
                candidates.append(parent / inner)
        for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
            if entry:
                candidates += [Path(entry) / rest, Path(entry).parent / rest]
    name = Path(rest).name
    candidates += [folder / meshdir / name, folder / name, folder / "meshes" / name]
    return next((path.resolve() for path in candidates if path.is_file()), None)


def _is_binary_stl(path: Path) -> bool:
    """Whether the size of the file agrees with its number of faces, and MuJoCo takes as many."""
    with path.open("rb") as file:
        count = int.from_bytes(file.read(84)[80:84], "little")
    return path.stat().st_size >= 84 + 50 * count and 1 <= count <= 200000
