"""Places of effects: joints, and other parts of a robot that have words of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from sgp_ros.physics.motion import SeenMotion, Structure

PLACES = {'base': -1, 'tool': -2, 'all': -3}
"""Words for places other than joints."""
NOWHERE = -4
"""Place of an effect whose robot is not known."""
SIDES = {'lower': -1, 'upper': 1}
_OTHER_PLACES = {index: name for name, index in PLACES.items()}


class Site(Enum):
    """Part of a robot that an effect may be put on."""

    JOINT = 'a joint'
    MOTOR = 'a motor'
    LAST = 'an outermost link of a URDF'
    BASE = 'base'
    TOOL = 'tool'


JOINT, MOTOR, LAST, BASE, TOOL = Site


def place_of_word(joint: str, site: Site | None) -> int | None:
    """Return one of `PLACES` where a word is one for what sits on a part of a robot, else None.

    Joints may be called `base` or `tool`: only what sits there takes these words for a place.
    """
    own = joint == 'all' or (site is not None and site in {BASE, TOOL} and joint == site.value)
    return PLACES[joint] if own else None


@dataclass(frozen=True, slots=True)
class Place:
    """Where an effect acts, and in which variant.

    Attributes:
        joint: index of the joint, or one of `PLACES`.
        kind: such as `coulomb` or `viscous`; empty where there is but one.
        source: index of the joint it comes from; -1 where there is none.
        side: 1 or -1 for an effect at one end of the range; 0 elsewhere.
        number: 0, or 1, 2, ... of further waves, or a second motor, of the same law there.
    """

    joint: int
    kind: str = ''
    source: int = -1
    side: int = 0
    number: int = 0

    @classmethod
    def of(
        cls, site: Site, edge: str, joint: str, words: Mapping[str, str],
        numbers: Mapping[str, float], tree: Structure,
    ) -> Place:  # fmt: skip
        """Return the place that a file states.

        Args:
            site: part of a robot that has it.
            edge: number that says where an effect at one end of the range begins; empty for
                others. The side is the nearer end, unless the word `side` says it.
            joint: name of a joint that moves on its own, or one of `PLACES`.
            words: `kind`, `source_joint` and `side`, where there are such.
            numbers: the stated ones.
            tree: the robot.

        Raises:
            ValueError: a joint that does not move on its own.
        """
        names = tree.moving_names
        word = place_of_word(joint, site)
        at = names.index(joint) if word is None else word
        source = names.index(words['source_joint']) if 'source_joint' in words else -1
        side = 0
        if edge:
            side = SIDES[words['side']] if 'side' in words else _side(tree, at, numbers[edge])
        return cls(at, words.get('kind', ''), source, side)


class Placed(Protocol):
    """A place with shape and coefficients, as a law reads them."""

    @property
    def place(self) -> Place:
        """Place where it acts."""

    @property
    def shape(self) -> np.ndarray:
        """Shape, (s,)."""

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients of the columns, (m,)."""


def joint_name(motion: SeenMotion, joint: int) -> str:
    """Return the name of a joint, or of another place, as in the schema."""
    return _OTHER_PLACES.get(joint) or motion.tree.joint_names[joint]


def side_word(side: int) -> str:
    """Return the word for a side of the range."""
    return 'upper' if side > 0 else 'lower'


def _side(tree: Structure, joint: int, edge: float) -> int:
    """Return the nearer end of the range; without limits, which side of zero."""
    lower, upper = float(tree.lower[joint]), float(tree.upper[joint])
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return 1 if edge > 0.0 else -1
    return 1 if upper - edge < edge - lower else -1
