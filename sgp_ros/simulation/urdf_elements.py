"""Elements of a URDF text, and the numbers in them."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from sgp_ros.errors import ConfigError

MOVING = ('revolute', 'continuous', 'prismatic')
"""Types of joints that move."""


def root_of(urdf: str) -> ET.Element:
    """Return the element `<robot>` of a URDF text.

    Raises:
        ConfigError: no XML, another element, or a document type.
    """
    if '<!DOCTYPE' in urdf or '<!ENTITY' in urdf:
        raise ConfigError('a URDF with a document type', 'one without', 'remove <!DOCTYPE ...>')
    try:
        root = ET.fromstring(urdf)  # noqa: S314  # no document type, so no entity to expand
    except ET.ParseError as error:
        raise ConfigError(f'the URDF is no XML ({error})', '<robot> ... </robot>') from error
    if root.tag != 'robot':
        raise ConfigError(f'<{root.tag}>', 'a URDF with <robot>', 'expand xacro files first')
    return root


def link_of(joint: ET.Element, end: str) -> str:
    """Return the link at the end `parent` or `child` of a joint.

    Raises:
        ConfigError: there is none.
    """
    element = joint.find(end)
    name = None if element is None else element.get('link')
    if not name:
        raise ConfigError(f'joint {joint.get("name")!r} without <{end}>', 'a link at both ends')
    return name


def number_of(element: ET.Element | None, key: str, absent: float) -> float:
    """Return a number among the attributes of an element that may be missing.

    Raises:
        ConfigError: an attribute that is no number.
    """
    text = None if element is None else element.get(key)
    return absent if text is None else _number(text, key)


def vector_of(element: ET.Element | None, key: str, absent: str) -> list[float]:
    """Return three numbers among the attributes of an element that may be missing.

    Raises:
        ConfigError: an attribute that is no three numbers.
    """
    text = absent if element is None else element.get(key, absent)
    numbers = [_number(word, key) for word in text.split()]
    if len(numbers) != len('xyz'):
        raise ConfigError(f'{key}="{text}" in the URDF', 'three numbers')
    return numbers


def _number(text: str, key: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ConfigError(f'{key}="{text}" in the URDF', 'a number') from error
