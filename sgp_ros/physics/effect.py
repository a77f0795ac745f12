"""Effects: physics beside the rigid bodies of a robot, one value per law.

The extra generalised force of a law is `tau_x = columns(shape) @ coefficients` in the convention
`M a + h = tau + tau_x`. The shape holds what enters otherwise (a width, an onset, a time
constant). What a motor or an encoder does is written as the force that would look the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sgp_ros.physics.drawing import Drawn, JointScene, Scene
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import OwnMotion, Quantity, SmallEffect, TermForm, Value, propagated
from sgp_ros.physics.place import BASE, JOINT, LAST, MOTOR, TOOL, Place, Placed, Site, side_word
from sgp_ros.physics.waves import Wave

EMPTY = np.zeros(0)
Numbers = Mapping[str, float]


class Effect:
    """A law of physics that a robot may have beside its rigid bodies.

    A subclass states attributes and methods. A law of one joint's own motion needs `local` alone:

    >>> class CubicDrag(Effect):
    ...     name = 'cubic_drag'
    ...     words = 'cubic drag'
    ...     formula = 'tau_x = -c v^3'
    ...     quantities = (Quantity('c', 'N m s3/rad3', low=0.0),)
    ...     linear = ('c',)
    ...     def local(self, x, shape):
    ...         return (-(x.v**3),)
    >>> law = CubicDrag()
    >>> law.local(OwnMotion(*np.array([[2.0, -1.0]] * 4)), EMPTY)
    (array([-8.,  1.]),)
    >>> law.model({'c': 0.5})
    (array([], dtype=float64), array([0.5]))

    `EFFECTS[law.name] = law` (see `catalogue`) makes it known to everything else.

    Attributes:
        name: as in the schema of a diagnosis.
        words, formula: for people, as in "missing on elbow: Coulomb friction"; `source` of them.
        appearance: what it looks like in data.
        quantities: the parameters that are stated and reported.
        linear: names of those that are coefficients, by column; without any the coefficient is 1.
        kinds: the variants it comes in; `kind_word` is the parameter that says which.
        plain, alike: laws it becomes without coupling, drift or way (least shape); usual ones
            that leave as little where only bodies tell them apart.
        site, has_source: what it sits on; whether it comes from another joint.
        edge: quantity that says where it begins, of an effect at one end of the range.
        needs_limits, takes_all: whether joints must have limits; whether it may act on all motors.
        size: stated number in which an effect without linear ones is linear nevertheless.
        term: how it enters a robot YAML under `terms`; None where it does not.
        small: to first order in its size; None where starts are shapes.
        drawn_over: a variable of the motion, `effort`, `time` (its size) or `seconds` (a few).
        is_force: it exerts a force; else it only changes what a sensor shows.
        is_online: a model that sees one time of the motion at once can hold it.
        is_dry: it holds a joint at rest; where there are kinds, only `coulomb` does.
        is_inertial, sees_acceleration: proportional to the acceleration; dependent on it.
        uses_bodies: its columns depend on the inertial parameters of the robot.
        is_body: it changes a body; where bodies may differ, it adds nothing.
        is_on_tree: it changes gravity or bodies, see `gravity` and `added_body`.
        is_of_command: it lies before the motor's current: a measured effort is behind it.
        has_memory, is_late: it depends on other times too; on commands of the past, by a time [s].
        stage: of a drive, from 1 for the one next to the command; 0 of what is none.
        is_open: a robot may have it or not, and its numbers are not known.
        is_usual, has_chosen_form: nearly every joint with a motor has it; the data chose its form.
    """

    name: str = ''
    words: str = ''
    formula: str = ''
    source: str = ''
    appearance: str = ''
    quantities: tuple[Quantity, ...] = ()
    linear: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    kind_word: str = 'kind'
    has_source: bool = False
    plain: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    site: Site = JOINT
    edge: str = ''
    needs_limits: bool = False
    takes_all: bool = False
    size: str = ''
    term: TermForm | None = None
    small: SmallEffect | None = None
    drawn_over: str = 'position'
    is_force: bool = True
    is_online: bool = True
    is_late: bool = False
    is_dry: bool = False
    is_inertial: bool = False
    uses_bodies: bool = False
    sees_acceleration: bool = False
    is_body: bool = False
    is_on_tree: bool = False
    is_of_command: bool = False
    has_memory: bool = False
    stage: int = 0
    is_open: bool = False
    is_usual: bool = False
    has_chosen_form: bool = False

    @property
    def key(self) -> str:
        """Unique name."""
        return self.name

    @property
    def is_given(self) -> bool:
        """Whether the coefficient is 1."""
        return not self.linear

    def held_joints(self, place: Place) -> frozenset[int]:
        """Return the joints that it can hold at rest."""
        return frozenset({place.joint} if self.is_dry and place.kind != 'viscous' else ())

    def stated_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return the numbers that state the effect, with their units on a revolute joint."""
        return tuple(q.of_kind(kind) for q in self.quantities if q.kinds in {(), (kind,)})

    def coefficient_quantities(self, kind: str = '') -> tuple[Quantity, ...]:
        """Return names and units of the linear coefficients, in the order of the columns."""
        known = {q.name: q for q in self.stated_quantities(kind)}
        return tuple(known[n] for n in self.linear if n in known) or (Quantity('scale', '1'),)

    def shape_names(self, kind: str = '') -> tuple[str, ...]:
        """Return the stated numbers that are not coefficients."""
        return tuple(q.name for q in self.stated_quantities(kind) if q.name not in self.linear)

    def model(self, numbers: Numbers, kind: str = '') -> tuple[np.ndarray, np.ndarray]:
        """Return shape (s,) and coefficients (m,) of stated numbers, the inverse of `report`.

        NaN stands where the numbers do not say it.
        """
        linear = [numbers[q.name] for q in self.coefficient_quantities(kind)] if self.linear else 1
        shape = [numbers[name] for name in self.shape_names(kind)]
        return np.array(shape, dtype=np.float64), np.array(linear, dtype=np.float64, ndmin=1)

    def report(self, at: Placed, motion: SeenMotion) -> dict[str, Value]:
        """Return the values of `quantities`, and the words that say which variant it is."""
        kind = at.place.kind
        known = self.stated_quantities(kind)
        named = dict(zip((q.name for q in self.coefficient_quantities(kind)), at.coefficients,
                         strict=False))  # fmt: skip
        named |= dict(zip(self.shape_names(kind), at.shape, strict=False))
        values: dict[str, Value] = {q.name: float(named[q.name]) for q in known}
        if kind:
            values[self.kind_word] = kind
        if at.place.source >= 0:
            values['source_joint'] = motion.tree.joint_names[at.place.source]
        return values

    def coefficient_std(self, numbers: Numbers, std: Numbers, kind: str = '') -> np.ndarray:
        """Return the standard deviations of the coefficients, (m,), see `propagated`."""
        if self.size:  # its coefficient scales the whole
            return np.array([std.get(self.size, math.inf) / max(abs(numbers[self.size]), 1e-300)])
        return propagated(lambda x: self.model(x, kind)[1], numbers, std)

    def stated_words(self, place: Place, tree: Structure) -> dict[str, str]:
        """Return the words that `EffectAt.stated` takes beside joint and numbers."""
        words = {self.kind_word: place.kind} if place.kind else {}
        if place.source >= 0:
            words['source_joint'] = tree.joint_names[place.source]
        return words | ({'side': side_word(place.side)} if self.edge else {})

    def surprise(self, at: Placed) -> float:
        """Return what the prior takes from such numbers [nats]; 0 where none is unlikely."""
        return 0.0

    def is_possible(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether signs and sizes can be: usually what must not be negative is positive."""
        known = self.stated_quantities if self.is_given else self.coefficient_quantities
        values = at.shape if self.is_given else at.coefficients
        named = zip(known(at.place.kind), values, strict=False)
        return all(bool(x > 0.0) for q, x in named if q.low >= 0.0)

    def is_inside(self, at: Placed, motion: SeenMotion) -> bool:
        """Return whether a fit has stayed off bounds at which this law becomes another one."""
        return True

    def interval(self, at: Placed, motion: SeenMotion) -> tuple[str, list[list[float]]] | None:
        """Return variable and intervals of the region it is confined to; None for everywhere."""
        return None

    def local(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the force per coefficient from one joint's own motion, element by element."""
        raise NotImplementedError

    def whole(self, motion: SeenMotion, at: Placed) -> np.ndarray:
        """Return the force, (n,) or (n, k), also above the bandwidth of the equations."""
        return self.columns(motion, at.place, at.shape) @ at.coefficients

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the force per coefficient [N m or N per unit of the coefficient].

        Args:
            motion: of n rows.
            place: where it acts.
            shape: (s,).

        Returns:
            (n, m) on the joint of the place, or (n, k, m).
        """
        j = place.joint
        seen = (motion.position, motion.velocity, motion.acceleration, motion.direction)
        return np.column_stack(self.local(OwnMotion(*(x[:, j] for x in seen)), shape))

    def term_columns(self, x: OwnMotion, shape: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the columns of its term, see `TermForm`, element by element as `local`."""
        assert self.term is not None
        force = self.local(x, shape)
        return tuple(-self.term.sign * force[i] for i in self.term.columns)

    def effort_columns(self, kind: str) -> tuple[int, ...]:
        """Return the columns that depend on the effort itself."""
        return ()

    def gravity(self, shape: np.ndarray, magnitude: float) -> np.ndarray:
        """Return gravity in the axes of the root for a law that turns it, (3,) [m/s^2]."""
        return np.array([0.0, 0.0, -magnitude])

    def added_body(self, shape: np.ndarray) -> np.ndarray:
        """Return the inertial parameters that it adds to a link, (10,)."""
        return np.zeros(10)

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return where it could act on a robot, in which variants."""
        if self.site is BASE:
            return [Place(-1)]
        if self.site is TOOL:
            return [Place(-2)] if motion.tool_columns.shape[2] else []
        if self.site is LAST:
            return [Place(joint) for joint in motion.tree.outermost]
        if not self.is_force or (self.is_of_command and motion.drive is None):
            return []
        return [
            Place(j, kind, side=side)
            for j in motion.moving_joints
            if self.site is not MOTOR or motion.tree.is_actuated[j]
            for kind in self.kinds or ('',)
            for side in ((-1, 1) if self.edge else (0,))
        ]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return shapes where a search starts, (starts, s); of a `small` one what that needs."""
        return np.zeros((1, 0))

    def bounds(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of the shape, (s,) each."""
        return np.zeros(0), np.zeros(0)

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the change of each number of a shape over which the columns change, (s,).

        A search takes steps of a part of it; usually the width of the bounds.
        """
        return np.asarray(np.subtract(*self.bounds(motion, place)[::-1]))

    def wave(self, motion: SeenMotion, place: Place) -> Wave | None:
        """Return the wave over the position that it is, which starts a search; usually None."""
        return None

    def sized(self, x: JointScene) -> Drawn:
        """Return its parameters in a drawn world, as a function of one size."""
        raise NotImplementedError

    def draw(self, scene: Scene) -> Drawn:
        """Return it as drawn on a robot; UnsuitableError where that cannot show it."""
        return self.sized(JointScene(scene))

    def bins(self, motion: SeenMotion, place: Place) -> tuple[np.ndarray, np.ndarray] | None:
        """Return columns of narrow bins (n, b) and their edges (b + 1,); None for most laws.

        The shape is then an interval, and the column the sum of those of the bins inside.
        """
        return None
