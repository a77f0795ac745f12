"""Identified parameters written back into a URDF, every other byte of it left as it was.

The parser only says where the elements lie; their text is exchanged in the source. So comments,
order, namespaces and white space stay, and a difference of the two files shows what was
identified.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np

from sgp_ros.errors import ConfigError

_Edit = tuple[int, int, str]
"""First byte, byte after the last one, and what comes in their place."""

_ENTRIES = ('ixx', 'ixy', 'iyy', 'ixz', 'iyz', 'izz')
_ROWS, _COLUMNS = (0, 1, 1, 2, 2, 2), (0, 0, 1, 0, 1, 2)


def write_urdf(
    source_text: str,
    parameters: Mapping[str, np.ndarray],
    dynamics: Mapping[str, tuple[float, float]],
) -> str:
    """Return a URDF with other inertias and joint friction.

    The frame of a link is the frame of the joint that carries it, so `parameters` are about the
    origin of the link, in its axes. They are those of the whole body that moves with the joint:
    links fixed to it are part of it, and their `<inertial>` is removed. Without rotation, the
    inertial frame of URDF lies in the centre of mass c = h / m, with
    `I_c = I - m (|c|^2 1 - c c^T)` (Steiner).

    Args:
        source_text: the URDF.
        parameters: moving link to (10,) mass [kg], first moment [kg m], and inertia tensor xx,
            xy, yy, xz, yz, zz about the origin [kg m^2], as in `inertial.PARAMETERS`.
        dynamics: joint to viscous damping [N m s/rad or N s/m] and Coulomb friction [N m or N].

    Raises:
        ConfigError: not a URDF, a named link or joint is missing, or a mass is not positive.
    """
    source = source_text.encode('utf-8')
    layout = _Layout.of(source)
    _check_names('links', parameters, layout.links)
    _check_names('joints', dynamics, layout.joints)
    edits: list[_Edit] = []
    for link, values in parameters.items():
        edits.append(_exchanged(source, layout.links[link], 'inertial', _inertial(link, values)))
        for fixed in layout.fixed_to(link):
            if fixed in parameters:
                raise ConfigError(
                    f'parameters are given for link {fixed}, which is fixed to link {link}',
                    'one set for each body that moves',
                    f'add them to those of {link}, in its frame',
                )
            inertial = layout.links[fixed].child('inertial')
            if inertial is not None:
                edits.append(_removed(source, inertial))
    for joint, (damping, friction) in dynamics.items():
        if not np.all(np.isfinite([damping, friction])):
            raise ConfigError(f'joint {joint}: dynamics {damping}, {friction}', 'finite numbers')
        text = f'<dynamics damping="{float(damping)!r}" friction="{float(friction)!r}"/>'
        edits.append(_exchanged(source, layout.joints[joint], 'dynamics', [text]))
    for start, stop, text in sorted(edits, reverse=True):
        source = source[:start] + text.encode('utf-8') + source[stop:]
    return source.decode('utf-8')


@dataclass(slots=True)
class _Element:
    """Where an element lies: bytes `start:stop`, what it holds between `inner` and `end`."""

    tag: str
    attributes: dict[str, str]
    start: int
    inner: int = 0
    end: int = 0
    stop: int = 0
    children: list[_Element] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether it is written as one tag, `<link name="a"/>`."""
        return self.inner == self.stop

    def child(self, tag: str) -> _Element | None:
        return next((child for child in self.children if child.tag == tag), None)


class _Places:
    """Builds the tree of elements; an event of the parser ends where the next one begins."""

    def __init__(self, source: bytes) -> None:
        self._source = source
        self._parser = expat.ParserCreate('utf-8')
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._finish
        self._parser.DefaultHandler = self._settle
        self._root = _Element('', {}, 0)
        self._open = [self._root]
        self._begun: _Element | None = None
        self._finished: _Element | None = None

    def read(self) -> _Element:
        try:
            self._parser.Parse(self._source, True)  # noqa: FBT003  # takes no keywords
        except expat.ExpatError as error:
            raise ConfigError(f'the robot description is not XML ({error})', 'a URDF') from error
        self._settle()
        return self._root.children[0]

    def _settle(self, *_: object) -> None:
        if self._begun is not None:
            self._begun.inner = self._parser.CurrentByteIndex
        if self._finished is not None:
            self._finished.stop = self._parser.CurrentByteIndex
        self._begun = self._finished = None

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._settle()
        self._begun = _Element(tag, attributes, self._parser.CurrentByteIndex)
        self._open[-1].children.append(self._begun)
        self._open.append(self._begun)

    def _finish(self, _: str) -> None:
        self._settle()
        element = self._open.pop()
        element.end = self._parser.CurrentByteIndex
        if self._source[element.inner - 2 : element.inner] == b'/>':
            element.end = element.stop = element.inner
        else:
            self._finished = element


@dataclass(frozen=True, slots=True)
class _Layout:
    """Links and joints of a URDF by name."""

    links: dict[str, _Element]
    joints: dict[str, _Element]

    @classmethod
    def of(cls, source: bytes) -> _Layout:
        root = _Places(source).read()
        if root.tag != 'robot':
            raise ConfigError(f'the root element is <{root.tag}>', 'a URDF with <robot>')
        named: dict[str, dict[str, _Element]] = {'link': {}, 'joint': {}}
        for child in root.children:
            if child.tag in named:
                named[child.tag][child.attributes.get('name', '')] = child
        return cls(named['link'], named['joint'])

    def fixed_to(self, link: str) -> list[str]:
        """Names of the links that fixed joints tie to `link`, directly or not."""
        found = []
        for joint in self.joints.values():
            parent, child = joint.child('parent'), joint.child('child')
            if joint.attributes.get('type') != 'fixed' or parent is None or child is None:
                continue
            name = child.attributes.get('link', '')
            if parent.attributes.get('link') == link and name in self.links:
                found += [name, *self.fixed_to(name)]
        return found


def _check_names(kind: str, given: Iterable[str], known: Iterable[str]) -> None:
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise ConfigError(f'the URDF has no {kind} {unknown}', f'some of {sorted(known)}')


def _inertial(link: str, parameters: np.ndarray) -> list[str]:
    """Return the lines of `<inertial>`; each number comes back to the bit."""
    values = np.asarray(parameters, dtype=np.float64)
    if values.shape != (10,) or not np.all(np.isfinite(values)) or values[0] <= 0.0:
        raise ConfigError(
            f'link {link}: parameters {values.tolist()}',
            'ten finite numbers, the first a positive mass',
            'project the estimate onto consistent bodies first',
        )
    mass, c = float(values[0]), values[1:4] / values[0]
    tensor = np.zeros((3, 3))
    tensor[_ROWS, _COLUMNS] = tensor[_COLUMNS, _ROWS] = values[4:]
    central = tensor - mass * ((c @ c) * np.eye(3) - np.outer(c, c))
    place = ' '.join(repr(float(x)) for x in c)
    entries = ' '.join(
        f'{name}="{float(x)!r}"'
        for name, x in zip(_ENTRIES, central[_ROWS, _COLUMNS], strict=True)
    )
    return [
        '<inertial>',
        f'  <origin xyz="{place}" rpy="0 0 0"/>',
        f'  <mass value="{mass!r}"/>',
        f'  <inertia {entries}/>',
        '</inertial>',
    ]


def _exchanged(source: bytes, element: _Element, tag: str, lines: list[str]) -> _Edit:
    """Put a child in the place of the one with its tag, or first if there is none."""
    newline = '\r\n' if b'\r\n' in source else '\n'
    old = element.child(tag)
    if old is not None:
        return old.start, old.stop, (newline + _indent(source, old)).join(lines)
    outer = newline + _indent(source, element)
    inner = outer + '  '
    text = inner + inner.join(lines)
    if element.is_empty:
        return element.stop - 2, element.stop, f'>{text}{outer}</{element.tag}>'
    return element.inner, element.inner, text


def _removed(source: bytes, element: _Element) -> _Edit:
    """Take out an element with the white space before it."""
    start = element.start
    while source[start - 1 : start].isspace():
        start -= 1
    return start, element.stop, ''


def _indent(source: bytes, element: _Element) -> str:
    """Return the white space before an element that begins a line."""
    line = source[source.rfind(b'\n', 0, element.start) + 1 : element.start].decode('utf-8')
    return line[: len(line) - len(line.lstrip())]
