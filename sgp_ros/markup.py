"""Texts of strangers in YAML and XML: bounds of nesting, entries, aliases and numbers."""

from __future__ import annotations

import sys
from typing import Any
from xml.etree import ElementTree as ET

import yaml

from sgp_ros.strangers import require_within

_QUOTED = ('"', "'", '|', '>')
_MEGABYTE = 1 << 20
_LIBYAML_DEPTH = 1000
YAMLError = yaml.YAMLError
_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
"""The one in C is ten times as fast."""


class _Loader(_SafeLoader):  # type: ignore[misc]  # whichever there is
    """A safe loader of numbers that one can compute with."""

    def construct_yaml_int(self, node: Any) -> int:
        """Return an integer that a float can stand for."""
        value: int = super().construct_yaml_int(node)
        if abs(value) > sys.float_info.max:
            line = node.start_mark.line + 1
            raise YAMLError(f'an integer of {len(node.value)} characters in line {line}')
        return value


_Loader.add_constructor('tag:yaml.org,2002:int', _Loader.construct_yaml_int)


def load_yaml(text: str) -> Any:
    """Return what a YAML text holds.

    Raises:
        TooMuchError: more nesting, entries or aliases than a settings file has.
        yaml.YAMLError: no YAML.
    """
    try:
        _require_bounded(text)
    except YAMLError as error:
        if 'nesting depth' in str(error):  # libyaml has a limit of its own, and looks ahead
            require_within(_LIBYAML_DEPTH, 'DEPTH', 'nesting depth of the YAML')
        raise
    try:
        return yaml.load(text, Loader=_Loader)  # noqa: S506  # a safe one
    except (ValueError, TypeError, OverflowError) as error:  # such as a date of month 13
        raise YAMLError(' '.join(str(error).split())) from error


class _Keys:
    """The keys so far of one mapping, of which a second one would replace the first in silence."""

    def __init__(self) -> None:
        self._seen: set[str] = set()
        self._is_next = True

    def take(self, event: Any) -> None:
        """Take the beginning of a key or of a value; they alternate."""
        if self._is_next and isinstance(event, yaml.ScalarEvent) and event.value != '<<':
            if event.value in self._seen:
                line = 0 if event.start_mark is None else event.start_mark.line + 1
                raise YAMLError(f'the key {event.value[:80]!r} is repeated in line {line}')
            self._seen.add(event.value)
        self._is_next = not self._is_next


def _require_bounded(text: str) -> None:
    """Refuse a YAML text beyond a bound; an alias counts as all that it stands for."""
    aliases = entries = 0
    inside: list[tuple[str | None, int, _Keys | None]] = []
    sizes: dict[str | None, int] = {}
    for event in yaml.parse(text, Loader=_Loader):
        if (
            inside
            and inside[-1][2]
            and not isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent))
        ):
            inside[-1][2].take(event)
        if isinstance(event, (yaml.MappingStartEvent, yaml.SequenceStartEvent)):
            keys = _Keys() if isinstance(event, yaml.MappingStartEvent) else None
            inside.append((event.anchor, entries, keys))
            require_within(len(inside), 'DEPTH', 'nesting depth of the YAML')
        elif isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
            anchor, before, _ = inside.pop()
            sizes[anchor] = entries - before
        elif isinstance(event, yaml.ScalarEvent):
            sizes[event.anchor] = 1
            if event.style not in _QUOTED:  # it is tried as a number
                require_within(len(event.value), 'LINE', 'length of an entry in the YAML')
        elif isinstance(event, yaml.AliasEvent):
            aliases += 1
            require_within(aliases, 'ALIASES', 'number of aliases in the YAML')
            if event.anchor not in sizes:
                raise YAMLError(f'the alias {event.anchor} has no anchor before it')
            entries += sizes[event.anchor]
        entries += 1
        require_within(entries, 'ENTRIES', 'number of entries in the YAML')


def parse_xml(text: str) -> ET.Element:
    """Return the root of an XML text without entities.

    Raises:
        TooMuchError: more nesting or elements than a robot has.
        ET.ParseError: no XML.
    """
    parser: Any = ET.XMLPullParser(('start', 'end'))
    depth = entries = 0
    for start in range(0, len(text), _MEGABYTE):
        parser.feed(text[start : start + _MEGABYTE])
        for kind, _ in parser.read_events():
            depth += 1 if kind == 'start' else -1
            entries += 1
            require_within(depth, 'DEPTH', 'nesting depth of the XML')
            require_within(entries, 'ENTRIES', 'number of elements in the XML')
    parser.close()
    return ET.fromstring(text)  # noqa: S314  # callers refuse document types and entities
