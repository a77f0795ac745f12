"""The simulation of a law of force that a formula states.

Beside its formula it shares nothing with the columns of a diagnosis. What jumps with the direction
of the joint's own motion is dry friction, which holds the joint at rest; `lag` and `play` carry
states of their own. The part of a sign that belongs to another joint jumps where that one turns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sgp_ros.errors import ConfigError
from sgp_ros.physics.grammar import MEMORY, TIME
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.parts import Value
from sgp_ros.physics.tool_law import ToolLaw
from sgp_ros.simulation.effects import Action, EffectParameter, Law, Moment
from sgp_ros.simulation.mechanism import SimulatedJoint
from sgp_ros.simulation.tool_pull import ToolPull
from sgp_ros.simulation.tree import pulled

_STIFF_S = 1e-3
"""Time constant with which the output of a play follows its edges [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """Where a formula is evaluated: a moment, and the direction of the joint's own motion.

    What goes into each function with memory is noted on the way: its signal and its constant.
    """

    moment: Moment
    direction: float
    inputs: dict[int, tuple[float, float]] = field(default_factory=dict)


def formula_law(law: FormulaLaw) -> Law:
    """Return what the simulation does for a law.

    Raises:
        ConfigError: one that depends on accelerations or on delayed signals.
    """
    own = tuple(
        EffectParameter(q.name, q.unit, q.low, default=law.known.get(q.name))
        for q in law.quantities
    )
    if isinstance(law, ToolLaw):
        return Law(changed=lambda tree, values: pulled(tree, ToolPull.of(law, values)), own=own)
    if law.sees_acceleration or 'delay' in law.law.functions:
        raise ConfigError(
            f'the law {law.formula!r} of an acceleration or a delay cannot be simulated',
            'a law of q, dq, tau and t, with lag or play',
            'use the effect armature for an inertia, command_delay for a delayed command',
        )
    return Law(
        lambda joints, joint, values: (_Built(law, joints, joint, values).action(),), own=own
    )


class _Built:
    """A law with its numbers on the joints of a robot."""

    def __init__(
        self, law: FormulaLaw, joints: tuple[SimulatedJoint, ...], joint: int,
        values: Mapping[str, Value],
    ) -> None:  # fmt: skip
        self._joint, self._own = joint, joints[joint].name
        self._names = [j.name for j in joints]
        self._values = {**law.known, **values}
        self._memories: list[str] = []
        self._force = law.law.compiled(self._parameter, self._signal, self._special)
        self._is_dry = law.is_dry

    def action(self) -> Action:
        joint = self._joint
        if not self._is_dry:
            return Action(joint, force=self._smooth, **self._memory())  # type: ignore[arg-type]
        return Action(joint, force=self._mean, dry_level=self._level, **self._memory())  # type: ignore[arg-type]

    def _at(self, moment: Moment, direction: float) -> float:
        return float(self._force(_At(moment, direction)))  # type: ignore[arg-type]  # a number

    def _smooth(self, moment: Moment) -> float:
        return self._at(moment, float(np.sign(moment.velocity[self._joint])))

    def _mean(self, moment: Moment) -> float:
        return 0.5 * (self._at(moment, 1.0) + self._at(moment, -1.0))

    def _level(self, moment: Moment, direction: int) -> float:
        return 0.5 * direction * (self._at(moment, -direction) - self._at(moment, direction))

    def _memory(self) -> dict[str, object]:
        if not self._memories:
            return {}

        def inputs(moment: Moment) -> list[tuple[float, float]]:
            at = _At(moment, float(np.sign(moment.velocity[self._joint])))
            self._force(at)
            return [at.inputs[i] for i in range(len(self._memories))]

        def rate(moment: Moment) -> tuple[float, ...]:
            given = zip(self._memories, inputs(moment), moment.state, strict=True)
            return tuple(_rate(kind, *xc, float(z)) for kind, xc, z in given)

        def start(position: float, velocity: float) -> tuple[float, ...]:
            q, v = (np.zeros(len(self._names)) for _ in range(2))
            state = np.zeros(len(self._memories))
            q[self._joint], v[self._joint] = position, velocity
            for _ in self._memories:  # one may hold another
                state = np.array([x for x, _ in inputs(Moment(0.0, q, v, 0.0 * q, state))])
            return tuple(state.tolist())

        return {'start': start, 'state_rate': rate, 'substep_s': _STIFF_S}

    def _parameter(self, name: str) -> Callable[[_At], object]:
        if name == TIME and name not in self._values:
            return lambda at: at.moment.time_s
        value = float(self._values[name])
        return lambda _at: value

    def _signal(self, kind: str, joint: str) -> Callable[[_At], object]:
        j = self._names.index(joint)
        channel = {'q': 'position', 'dq': 'velocity', 'tau': 'drive'}[kind]
        return lambda at: float(getattr(at.moment, channel)[j])

    def _special(
        self, name: str, signals: frozenset[tuple[str, str]]
    ) -> Callable[..., object] | None:
        if name in MEMORY:
            self._memories.append(name)
            return _remembered(len(self._memories) - 1)
        if name == 'sign' and signals == {('dq', self._own)}:
            return lambda at, speed: at.direction if self._is_dry else float(np.sign(speed))
        return None


def _remembered(number: int) -> Callable[..., float]:
    def state(at: _At, x: float, constant: float) -> float:
        at.inputs[number] = float(x), float(constant)
        return float(at.moment.state[number])

    return state


def _rate(kind: str, x: float, constant: float, z: float) -> float:
    """Return the time derivative of what a lag, or a play, makes of x."""
    if kind == 'lag':
        return (x - z) / max(constant, _STIFF_S)
    return (min(max(z, x - 0.5 * constant), x + 0.5 * constant) - z) / _STIFF_S
