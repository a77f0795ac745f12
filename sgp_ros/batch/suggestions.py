"""Which motion would show the parameters that a recording did not: tried out and put in words.

Sinusoids of single joints and of pairs, the others held still, run through the regressor of the
robot beside what the recording holds. Those that add most are suggested.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sgp_ros.batch.excitation import JointRange, joint_ranges, judge_excitation, structural_base
from sgp_ros.errors import ConfigError
from sgp_ros.gp.linear_algebra import singular_values
from sgp_ros.physics.term import Motion
from sgp_ros.rigid.base_parameters import BaseParameters, RegressorFactor
from sgp_ros.robots.robot import Robot

_SAMPLES, _POSES = 48, 2
_RATIO = 1.6180339887
"""Frequency of the second joint of a pair over the first: no common period (golden section)."""


@dataclass(frozen=True, slots=True)
class Sinusoid:
    """`q(t) = centre + amplitude sin(frequency t)` of one joint [rad or m, rad/s]."""

    joint: str
    centre: float
    amplitude: float
    frequency: float

    def text(self, unit: str) -> str:
        """Say it with the largest speed and acceleration; `unit` is rad or m."""
        speed = self.amplitude * self.frequency
        return (
            f'{self.joint} by {self.amplitude:.3g} {unit} about {self.centre:.3g} {unit}'
            f' (up to {speed:.3g} {unit}/s and {speed * self.frequency:.3g} {unit}/s^2)'
        )


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """A motion that shows what a recording did not.

    Attributes:
        moving: one or two joints.
        held: position of the others [rad or m].
        gained: number of directions it adds to those already excited.
        shows: base parameters that this makes determined, in words.
        text: the motion and its gain in words.
    """

    moving: tuple[Sinusoid, ...]
    held: Mapping[str, float]
    gained: int
    shows: tuple[str, ...]
    text: str


def suggest_motions(
    robot: Robot,
    recorded: RegressorFactor,
    rng: np.random.Generator,
    *,
    ranges: Mapping[str, JointRange] | None = None,
    limit: int = 3,
) -> tuple[Suggestion, ...]:
    """Return motions that show what the recording did not, the most helpful first.

    Candidates are sinusoids of every joint and every pair, the other joints held in random poses.
    Each is judged together with all that came before: by the number of directions that it adds,
    then by the sum of the logarithms of the singular values over the structural directions, in
    which the smallest one weighs most. Greedy, until no direction is missing. O(k^2) candidates.

    Args:
        robot: inverse model, from motion to efforts.
        recorded: factor of the recording's regressor; `RegressorFactor.nothing(p)` for none.
        rng: of the poses.
        ranges: by joint; what is missing is that of the robot's file.
        limit: number of suggestions.

    Raises:
        ConfigError: a forward model, whose regressor needs efforts, not accelerations.
    """
    if robot.target != 'effort':
        raise ConfigError(
            f'robot {robot.name} predicts {robot.target}', 'a robot that predicts effort'
        )
    ranges = joint_ranges(robot, ranges)
    structural = structural_base(robot, rng, ranges=ranges)
    trials = [
        (moving, held, RegressorFactor.nothing(len(structural.names)).with_rows(F))
        for moving, held, F in _candidates(robot, rng, ranges)
    ]
    suggestions: list[Suggestion] = []
    while len(suggestions) < limit and trials:
        before = judge_excitation(structural, recorded)
        together = [recorded.with_rows(trial.R) for *_, trial in trials]
        scores = [_score(structural, x) for x in together]
        best = max(range(len(trials)), key=scores.__getitem__)
        gained = scores[best][0] - before.excited.rank
        if not before.missing or gained <= 0:
            break
        recorded = together[best]
        after = judge_excitation(structural, recorded)
        moving, held, _ = trials[best]
        shows = tuple(text for text in before.unexcited if text not in after.unexcited)
        text = _in_words(robot, moving, held, gained, shows)
        suggestions.append(Suggestion(moving, held, gained, shows, text))
    return tuple(suggestions)


def _candidates(
    robot: Robot, rng: np.random.Generator, ranges: Mapping[str, JointRange]
) -> Iterator[tuple[tuple[Sinusoid, ...], dict[str, float], np.ndarray]]:
    singles = [(name,) for name in ranges]
    for names in (*singles, *combinations(ranges, 2)):
        for _ in range(_POSES):
            pose = {name: rng.uniform(x.lower, x.upper) for name, x in ranges.items()}
            moving = tuple(
                _sinusoid(name, ranges[name], 1.0 if i else 1.0 / _RATIO)
                for i, name in enumerate(names)
            )
            held = {name: float(q) for name, q in pose.items() if name not in names}
            yield moving, held, robot.regressor(_motion(robot, moving, held))


def _sinusoid(name: str, limit: JointRange, slowness: float) -> Sinusoid:
    """Use most of the range, as fast as speed and acceleration allow, times `slowness`."""
    amplitude = 0.45 * (limit.upper - limit.lower)
    frequency = min(limit.velocity / amplitude, np.sqrt(limit.acceleration / amplitude))
    centre = 0.5 * (limit.lower + limit.upper)
    return Sinusoid(name, centre, amplitude, float(slowness * frequency))


def _motion(robot: Robot, moving: Sequence[Sinusoid], held: Mapping[str, float]) -> Motion:
    q = np.array([[held.get(name, 0.0) for name in robot.joint_names]] * _SAMPLES)
    v, a = np.zeros_like(q), np.zeros_like(q)
    slowest = min(s.frequency for s in moving)
    time = np.linspace(0.0, 4.0 * np.pi / slowest, _SAMPLES, endpoint=False)
    for s in moving:
        j, phase = robot.joint_names.index(s.joint), s.frequency * time
        q[:, j] = s.centre + s.amplitude * np.sin(phase)
        v[:, j] = s.amplitude * s.frequency * np.cos(phase)
        a[:, j] = -s.amplitude * s.frequency**2 * np.sin(phase)
    return Motion(q, v, a, np.zeros_like(q))


def _score(structural: BaseParameters, factor: RegressorFactor) -> tuple[int, float]:
    """Return the rank and the sum of logarithms of the singular values, in structural scales."""
    excited = factor.base_parameters(structural.names)
    shown = factor.R / structural.scale @ structural.directions[: structural.rank].T
    values = singular_values(shown)
    return excited.rank, float(np.log(np.maximum(values, excited.tolerance)).sum())


def _in_words(
    robot: Robot,
    moving: Sequence[Sinusoid],
    held: Mapping[str, float],
    gained: int,
    shows: Sequence[str],
) -> str:
    units = {joint.name: joint.unit('position') for joint in robot.joints}
    text = 'move ' + ' and '.join(s.text(units[s.joint]) for s in moving)
    if held:
        places = (f'{name} at {q:.3g} {units[name]}' for name, q in held.items())
        text += ', hold ' + ', '.join(places)
    text += f': determines {gained} more combination' + ('s' if gained > 1 else '')
    return text + (f', shows {"; ".join(shows)}' if shows else '')
