"""Robot as the estimator sees it: joints, and physics that is linear in its coefficients.

`X(u) = f(u) W + Z(u)` (Wu and Movellan, equation 2). A `Term` contributes columns of `f`; a
`Robot` is a tuple of terms. Its target says which side of the equation of motion is predicted:
`acceleration` (forward model) or `effort` (inverse model). The other one is then an input.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.motion import Commands
from sgp_ros.physics.term import INPUT_CHANNELS, Coefficient, Joint, Motion, Term
from sgp_ros.robots.bodies import LumpedBodies


class ActingEffort(Protocol):
    """How recorded efforts become those that act."""

    @property
    def memory_s(self) -> float:
        """How long a command matters after the next one [s]."""

    def __call__(
        self, effort: np.ndarray, velocity: np.ndarray, *, is_measured: bool
    ) -> np.ndarray:
        """Return the efforts (n, k) that act at once, of recorded ones."""

    def late_effort(self, drive: Commands) -> np.ndarray:
        """Return what comes later than the commands, over what they are now, (n, k)."""


class RestForce(Protocol):
    """Range of dry friction where joints rest."""

    @property
    def joints(self) -> frozenset[int]:
        """Indices of the joints that it holds."""

    @property
    def coulomb_width(self) -> float:
        """Velocity over which it changes its sign [rad/s or m/s]."""

    def __call__(self, motion: Motion) -> np.ndarray:
        """Return the least and the largest force beyond the one that the rows take, (2, n, k)."""


@dataclass(frozen=True, slots=True)
class Robot:
    """Joints and the physics that is known of them.

    Attributes:
        name: of the robot.
        joints: k of them; their order is the order of all arrays.
        target: `acceleration` or `effort`, what f(u) W predicts.
        terms: the physics.
        residual_inputs: per joint, the names (`velocity:pole`) of what its Z sees.
        description: one sentence with the source of the model.
        source: the entries of a robot YAML that build this robot; empty for a built-in one.
        effort_map: from recorded efforts to those that act on the joints, see
            `effect_terms.EffortMap`; None for the same.
        rest_friction: what stated dry friction may do at rest beyond what the rows take, see
            `effect_terms.RestFriction`; None without any.
        bodies: of a robot that lumped coefficients describe; None for one from a URDF.

    Examples:
        A driven pendulum, `effort = J a + G sin(q)`, from columns of f(u):

        >>> import numpy as np
        >>> from sgp_ros.physics.formula import read_formula
        >>> def term(name, unit, text):
        ...     column = read_formula(text).column(['hinge'])
        ...     columns = lambda motion: column(motion)[:, None, None]
        ...     return Term((Coefficient(name, unit, 'hinge'),), columns, 'Newton')
        >>> robot = Robot(
        ...     name='pendulum', joints=(Joint('hinge'),), target='effort',
        ...     terms=(term('J', 'kg m^2', 'ddq[hinge]'), term('G', 'N m', 'sin(q[hinge])')),
        ...     residual_inputs=(('velocity:hinge',),),
        ... )
        >>> q, v, a, effort = np.array([[[0.5]], [[2.0]], [[3.0]], [[0.0]]])
        >>> robot.regressor(Motion(q, v, a, effort)).round(2)
        array([[[3.  , 0.48]]])
        >>> robot.target_unit('hinge'), robot.residual_columns(('default',))
        ('N m', ((1,),))
    """

    name: str
    joints: tuple[Joint, ...]
    target: str
    terms: tuple[Term, ...]
    residual_inputs: tuple[tuple[str, ...], ...]
    description: str = ''
    source: Mapping[str, object] = field(default_factory=dict, compare=False)
    effort_map: ActingEffort | None = None
    rest_friction: RestForce | None = None
    bodies: LumpedBodies | None = field(default=None, compare=False)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def complement(self) -> str:
        """The channel that is an input where `target` is the output."""
        return 'effort' if self.target == 'acceleration' else 'acceleration'

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The elements of W in the order of the columns, p of them."""
        return tuple(c for term in self.terms for c in term.coefficients)

    def target_unit(self, joint: str) -> str:
        """Return the unit of the target of `joint`."""
        return self.joints[self.joint_names.index(joint)].unit(self.target)

    def regressor(self, motion: Motion) -> np.ndarray:
        """Return f(u) for every time of `motion`, (n, k, p)."""
        blocks = [term.columns(motion) for term in self.terms]
        if not blocks:
            return np.zeros((*motion.position.shape, 0))
        return np.concatenate(blocks, axis=2)

    def inputs(self, motion: Motion) -> np.ndarray:
        """Return all that Z could see, in the order of `INPUT_CHANNELS`, (n, 5 k).

        The direction of a joint is `tanh(velocity / direction_width)`. Dry friction jumps with
        it, and a smooth function of the velocity can follow a jump only with length scales that
        leave it without memory elsewhere.
        """
        widths = np.array([joint.direction_width for joint in self.joints])
        direction = np.tanh(motion.velocity / widths)
        quantities = (motion.position, motion.velocity, motion.acceleration, motion.effort)
        return np.hstack([*quantities, direction])

    def residual_columns(self, spec: Sequence[str]) -> tuple[tuple[int, ...], ...]:
        """Resolve what Z sees to columns of `inputs`, one tuple per joint.

        Args:
            spec: `('default',)` for the robot's own choice, `('all',)` for the state and the
                other input, `('own',)` for position and velocity of the joint itself, or names
                such as `velocity:pole`, which then hold for every joint; `own:direction` is the
                direction of the joint itself, `every:velocity` stands for those of all joints.

        Raises:
            ConfigError: a name that is not an input of this robot.
        """
        if tuple(spec) == ('default',):
            named = self.residual_inputs
        elif tuple(spec) == ('own',):
            named = tuple((f'position:{j}', f'velocity:{j}') for j in self.joint_names)
        elif tuple(spec) == ('all',):
            named = (self._input_names()[: -len(self.joints)],) * len(self.joints)
        else:
            whole = [each for name in spec for each in _of_every_joint(name, self.joint_names)]
            named = tuple(
                tuple(_of_own_joint(name, joint) for name in whole) for joint in self.joint_names
            )
        return tuple(tuple(self._column(name) for name in names) for names in named)

    def input_name(self, column: int) -> str:
        """Return the name of a column of `inputs`, such as `velocity:pole`."""
        channel, joint = divmod(column, len(self.joints))
        return f'{INPUT_CHANNELS[channel]}:{self.joint_names[joint]}'

    def renamed(self, names: Sequence[str]) -> Robot:
        """Return this robot with other joint names, in the same order.

        Raises:
            ConfigError: another number of names than joints, or repeated names.
        """
        if len(names) != len(self.joints) or len(set(names)) != len(names):
            raise ConfigError(
                f'joints {list(names)} for robot {self.name}',
                f'{len(self.joints)} different names in the order {list(self.joint_names)}',
            )
        new = dict(zip(self.joint_names, names, strict=True))
        return replace(
            self,
            joints=tuple(replace(joint, name=new[joint.name]) for joint in self.joints),
            terms=tuple(_renamed_term(term, new) for term in self.terms),
            residual_inputs=tuple(
                tuple(_renamed_input(name, new) for name in inputs)
                for inputs in self.residual_inputs
            ),
        )

    def with_inputs(self, spec: object) -> Robot:
        """Return this robot with another choice of what Z sees.

        Args:
            spec: one name or a list of names, as `residual_columns` takes them.

        Raises:
            ConfigError: not of this form, or a name that is not an input of this robot.
        """
        names = [spec] if isinstance(spec, str) else spec
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ConfigError(f'residual_inputs is {spec!r}', 'own, all or a list of inputs')
        columns = self.residual_columns(tuple(names))
        inputs = tuple(tuple(self.input_name(c) for c in chosen) for chosen in columns)
        return replace(self, residual_inputs=inputs)

    def with_prior(self, prior: Mapping[str, tuple[float, float]]) -> Robot:
        """Return this robot with prior mean and standard deviation of some coefficients.

        Args:
            prior: coefficient name to (mean, std) in the coefficient's unit.

        Raises:
            ConfigError: a name that is not a coefficient of this robot.
        """
        known = [c.name for c in self.coefficients]
        unknown = sorted(set(prior) - set(known))
        if unknown:
            raise ConfigError(
                f'unknown parameters {unknown} of robot {self.name}', f'some of {known}'
            )
        return replace(self, terms=tuple(_with_prior(term, prior) for term in self.terms))

    def _input_names(self) -> tuple[str, ...]:
        channels = ('position', 'velocity', self.complement, 'direction')
        return tuple(
            f'{channel}:{joint.name}'
            for channel in channels
            for joint in self.joints
            if channel != 'effort' or joint.is_actuated
        )

    def _column(self, name: str) -> int:
        names = self._input_names()
        if name not in names:
            raise ConfigError(
                f'unknown residual input {name!r}',
                f'default, own, all, own:CHANNEL such as own:velocity, or some of {list(names)}',
            )
        channel, joint = name.split(':', 1)
        return INPUT_CHANNELS.index(channel) * len(self.joints) + self.joint_names.index(joint)


def _of_every_joint(name: str, joints: Sequence[str]) -> list[str]:
    channel = name.removeprefix('every:')
    return [name] if channel == name else [f'{channel}:{joint}' for joint in joints]


def _of_own_joint(name: str, joint: str) -> str:
    place, _, channel = name.partition(':')
    return f'{channel}:{joint}' if place == 'own' and channel else name


def _renamed_term(term: Term, new: Mapping[str, str]) -> Term:
    coefficients = tuple(
        replace(c, joint=new.get(c.joint or '', c.joint)) for c in term.coefficients
    )
    return replace(term, coefficients=coefficients)


def _renamed_input(name: str, new: Mapping[str, str]) -> str:
    channel, joint = name.split(':', 1)
    return f'{channel}:{new[joint]}'


def _with_prior(term: Term, prior: Mapping[str, tuple[float, float]]) -> Term:
    coefficients = tuple(
        replace(c, prior_mean=prior[c.name][0], prior_std=prior[c.name][1])
        if c.name in prior
        else c
        for c in term.coefficients
    )
    return replace(term, coefficients=coefficients)
