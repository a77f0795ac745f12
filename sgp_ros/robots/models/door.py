"""The one door for robot files of other programs: URDF, xacro, MJCF and SDF.

What a file states becomes the content of a robot YAML, so that every command and the node read
all formats alike. Files are named by a path, or by `package://NAME/PATH`, `model://NAME/PATH` or
`file://PATH` as ROS and Gazebo do.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree import ElementTree as ET

from sgp_ros.apart import read_apart
from sgp_ros.errors import ConfigError
from sgp_ros.markup import parse_xml
from sgp_ros.optional import optional_package
from sgp_ros.robots.models.mjcf import read_mjcf
from sgp_ros.robots.models.sdf import read_sdf
from sgp_ros.strangers import read_text

READ = (
    ('link; inertial mass, origin, inertia', 'link with mass, centre and inertia'),
    ('joint revolute, continuous, prismatic, fixed; origin, axis', 'joint'),
    ('limit lower, upper, velocity, effort', 'range and limits'),
    ('dynamics damping, friction', 'damping and dry friction of the joint'),
    ('mimic; mimic of ros2_control', 'joint that follows another'),
    ('ros2_control command_interface', 'which joints are driven'),
)
"""Elements of a URDF that are read, and their meaning here."""
LEFT = {
    'reduction': 'Reductions of <transmission> are ignored: efforts and positions are those at '
    'the joint.',
    'gazebo': 'Springs in <gazebo> are ignored: state them under `effects`.',
    'xacro': 'xacro elements in a URDF are ignored: rename the file to .xacro to expand them.',
}
"""Remarks on what has no place here."""
REFUSED = ('floating and planar joints', 'loops of links', 'several links without a parent')

MODEL_ENDINGS = ('.urdf', '.xacro', '.xml', '.mjcf', '.sdf', '.world')
"""Of files that `read_model` reads."""
_ROOTS = {'mujoco': 'mjcf', 'sdf': 'sdf', 'robot': 'urdf'}
_OTHER = {'.mjcf': 'mjcf', '.sdf': 'sdf', '.world': 'sdf', '.xacro': 'xacro', '.urdf': 'urdf'}


def is_model(name: str) -> bool:
    """Return whether a name is that of a model file or a robot YAML, and not of a recording."""
    return Path(name).suffix.lower() in {*MODEL_ENDINGS, '.yaml', '.yml'}


def read_model(path: Path) -> dict[str, Any]:
    """Return what a model file says, as the content of a robot YAML.

    Raises:
        ConfigError: a file of no known format, or with something that no robot here can have.
    """
    kind = _OTHER.get(path.suffix.lower()) or _kind_of(path)
    if kind == 'mjcf':
        return {**_compiled(path), 'model': str(path.resolve())}
    if kind == 'sdf':
        return read_sdf(path).document()
    if kind == 'xacro':
        text = _expanded(path)
        return {'schema': 1, 'urdf': text, **_remarks(text)}
    return {'schema': 1, 'urdf': str(path.resolve()), **_remarks(_text(path))}


def find_file(name: str, folder: Path) -> Path:
    """Return the file that a path or address names.

    A package is looked for where ROS has it installed, and then beside and above `folder`.

    Args:
        name: a path, or `package://`, `model://` or `file://` with one.
        folder: that a relative path starts from.

    Raises:
        ConfigError: no such package.
    """
    scheme, found, rest = name.partition('://')
    if not found:
        return folder / name
    if scheme == 'file':
        return Path(rest)
    if scheme not in {'package', 'model'}:
        raise ConfigError(f'unknown address {name!r}', 'package://, model:// or file://')
    package, _, inner = rest.partition('/')
    places = [*_installed(package), *(up / package for up in (folder, *folder.resolve().parents)),
              *(up for up in folder.resolve().parents if up.name == package)]  # fmt: skip
    if folder.resolve().name == package:
        places.append(folder)
    for place in places:
        if (place / inner).exists():
            return place / inner
    raise ConfigError(
        f'{name}: no package {package} with {inner}', 'an installed package or a parent folder',
        'source the workspace, or give the path of the file',
    )  # fmt: skip


def _installed(package: str) -> list[Path]:
    """Return where ROS has a package; nothing without ROS."""
    try:
        index = optional_package('ament_index_python.packages', 'to find packages', 'wheels')
    except ConfigError:
        return []
    try:
        return [Path(index.get_package_share_directory(package))]
    except (LookupError, ValueError, OSError):  # not installed, or no workspace is sourced
        return []


def _kind_of(path: Path) -> str:
    """Return the format of an XML file by its root element."""
    text = _text(path)
    try:
        tag = parse_xml(text).tag
    except ET.ParseError as error:
        raise ConfigError(f'{path.name} is not XML ({error})', 'URDF, MJCF or SDF') from error
    if tag not in _ROOTS:
        raise ConfigError(f'{path.name} has the root element <{tag}>', 'URDF, MJCF or SDF')
    return _ROOTS[tag]


def _text(path: Path) -> str:
    try:
        text = read_text(path).lstrip()
    except UnicodeDecodeError as error:
        raise ConfigError(f'{path.name} is not UTF-8 ({error})', 'a model in UTF-8') from error
    if '<!DOCTYPE' in text or '<!ENTITY' in text:
        raise ConfigError(
            f'{path.name} contains a document type declaration',
            'a model file',
            'remove <!DOCTYPE ...>',
        )
    return text


def _expanded(path: Path) -> str:
    """Return the URDF that a xacro file stands for, with its default arguments."""
    expected = 'a file that xacro expands without arguments'
    return read_apart(f'{__name__}:write_expanded', path, ConfigError, expected).decode()


def write_expanded(path: Path, stream: BinaryIO) -> None:
    """Write the URDF that a xacro file stands for.

    Raises:
        ConfigError: xacro is missing, or fails in whatever way such a program may.
    """
    xacro = optional_package('xacro', 'to read .xacro files', 'models')
    try:
        text: str = xacro.process_file(str(path)).toxml()
    except Exception as error:
        raise ConfigError(
            f'xacro {path.name}: {" ".join(str(error).split()) or type(error).__name__}',
            'a file that xacro expands without arguments',
            'expand it yourself: xacro FILE name:=value > robot.urdf',
        ) from error  # fmt: skip
    stream.write(text[text.index('<robot') :].encode())


def _compiled(path: Path) -> dict[str, Any]:
    """Return what MuJoCo's compiler makes of an MJCF file."""
    data = read_apart(
        f'{__name__}:write_compiled', path, ConfigError, 'a file that MuJoCo compiles'
    )
    document: dict[str, Any] = json.loads(data)
    return document


def write_compiled(path: Path, stream: BinaryIO) -> None:
    """Write what MuJoCo's compiler makes of an MJCF file as JSON.

    Raises:
        ConfigError: a file that cannot be read, see `read_mjcf`.
    """
    stream.write(json.dumps(read_mjcf(path).document()).encode())


def _remarks(text: str) -> Mapping[str, list[str]]:
    """Report dynamics of a URDF that have no place here."""
    try:
        root = parse_xml(text)
    except ET.ParseError:
        return {}  # who reads the URDF says so
    found = []
    reductions = [x for x in root.iter('mechanicalReduction') if (x.text or '1').strip() not in
                  {'1', '1.0'}]  # fmt: skip
    if reductions:
        found.append(LEFT['reduction'])
    springs = [x for tag in ('springStiffness', 'springReference') for x in root.iter(tag)]
    if springs:
        found.append(LEFT['gazebo'])
    if any(str(x.tag).startswith('{') and 'xacro' in str(x.tag) for x in root.iter()):
        found.append(LEFT['xacro'])
    return {'remarks': found} if found else {}
