"""The nominal model of a robot, with which a recording is compared: bodies and known effects."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.effect_at import EffectAt, in_series
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.effect_terms import changed_tree
from sgp_ros.robots.robot import Robot
from sgp_ros.robots.stated_effects import dry_friction, read_effects
from sgp_ros.robots.stated_values import (
    NO_BODY,
    term_effects,
    values_of,
    with_coefficients,
    with_values,
)
from sgp_ros.robots.urdf_robot import build_urdf_robot, nominal_tree, term_shape


@dataclass(frozen=True, slots=True, eq=False)
class Nominal:
    """Nominal robot: all that is taken as known of a robot.

    Attributes:
        robot: from a URDF.
        plain: the tree of the URDF.
        loaded: the same with stated tilt of the base and payload.
        tree: the same with the bodies, damping and friction that are stated by value.
        effects: all others that it states.
        impossible: remarks on values that nothing can have.
        is_lumped: whether it is known by its coefficients alone.
    """

    robot: Robot
    plain: Tree
    loaded: Tree
    tree: Tree
    effects: tuple[EffectAt, ...]
    impossible: tuple[str, ...] = ()
    is_lumped: bool = False

    @property
    def stated(self) -> tuple[EffectAt, ...]:
        """The effects that are not part of the tree, dry friction of joints among them.

        And laws that the robot may have or not. Drives of a motor stand in series.
        """
        known = (*self.effects, *dry_friction(self.tree))
        return in_series([e for e in known if e.is_complete and not e.effect.is_on_tree])

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the user."""
        lumped = (
            f'The bodies of {self.robot.name} are the simplest ones that have its coefficients: '
            'mass and centre of mass of a single link are not known.'
        )
        unclear = tuple(
            f'{e.name} of {e.joint} is not part of the nominal robot: not all of its parameters '
            'are stated.'
            for e in self.effects
            if not e.is_complete
        )
        said = self.robot.source.get('remarks') or ()
        assert isinstance(said, list | tuple)
        lumped_said = (lumped,) if self.is_lumped else ()
        return (*lumped_said, *map(str, said), *self.impossible, *unclear)

    @property
    def lacks_bodies(self) -> bool:
        """Whether bodies are stated that cannot exist."""
        links = self.plain.link_names
        return any(NO_BODY.format(link=link) in self.impossible for link in links)

    def without_stated(self, bodies: np.ndarray | None) -> np.ndarray | None:
        """Return bodies (b, 10) of a diagnosis less the payload that the robot states."""
        return (
            None if bodies is None else bodies - (self.loaded.parameters - self.plain.parameters)
        )


def nominal_model(robot: Robot) -> Nominal:
    """Return the nominal model of a robot; one of lumped coefficients becomes one with a URDF.

    Raises:
        ConfigError: the robot has no nominal bodies, or its URDF is no longer what it was.
    """
    problems: list[str] = []
    bodies = robot.bodies
    if bodies is not None:
        document = bodies.document(robot.name, robot.joints, robot.coefficients)
        built = build_urdf_robot(document, Path(), problems)
        if built is None or problems:
            raise ConfigError(
                f'robot {robot.name}: ' + ' | '.join(problems), 'physically possible bodies'
            )
        robot = built
    plain = nominal_tree(robot)
    effects = read_effects(robot.source.get('effects'), plain, problems)
    if problems:
        raise ConfigError(f'robot {robot.name}: ' + ' | '.join(problems), 'valid effects')
    values, remarks = values_of(robot), list[str]()
    loaded = changed_tree(plain, effects)
    effects = (
        *with_coefficients(effects, values, plain),
        *term_effects(plain, values, term_shape(robot), remarks),
    )
    tree = with_values(loaded, values, remarks)
    return Nominal(robot, plain, loaded, tree, effects, tuple(remarks), bodies is not None)
