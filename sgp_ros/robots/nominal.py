"""The nominal model of a robot, with which a recording is compared: bodies and known effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sgp_ros.errors import ConfigError
from sgp_ros.robots.effect_terms import ON_TREE, changed_tree
from sgp_ros.robots.stated_effects import read_effects
from sgp_ros.robots.urdf_robot import nominal_tree

if TYPE_CHECKING:
    import numpy as np

    from sgp_ros.robots.robot import Robot
    from sgp_ros.robots.stated_effects import StatedEffect
    from sgp_ros.robots.tree import Tree


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """What is taken for known of a robot.

    Attributes:
        robot: from a URDF.
        plain: the tree of the URDF.
        tree: the same with stated tilt of the base and payload.
        effects: all that it states.
    """

    robot: Robot
    plain: Tree
    tree: Tree
    effects: tuple[StatedEffect, ...]

    @property
    def stated(self) -> tuple[StatedEffect, ...]:
        """The effects that are not part of the tree."""
        return tuple(e for e in self.effects if e.is_complete and e.name not in ON_TREE)

    @property
    def left_out(self) -> tuple[StatedEffect, ...]:
        """The effects whose stated numbers do not say what they do."""
        return tuple(e for e in self.effects if not e.is_complete)

    def without_stated(self, bodies: np.ndarray | None) -> np.ndarray | None:
        """Return bodies (b, 10) of a diagnosis less the payload that the robot states."""
        return None if bodies is None else bodies - (self.tree.parameters - self.plain.parameters)


def nominal_model(robot: Robot) -> Nominal:
    """Return the nominal model of a robot.

    Raises:
        ConfigError: the robot has no nominal bodies, or its URDF is no longer what it was.
    """
    plain = nominal_tree(robot)
    problems: list[str] = []
    effects = read_effects(robot.source.get('effects'), plain, problems)
    if problems:
        raise ConfigError(f'robot {robot.name}: ' + ' | '.join(problems), 'as it was before')
    return Nominal(robot, plain, changed_tree(plain, effects), effects)
