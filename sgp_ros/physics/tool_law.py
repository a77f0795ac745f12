"""Laws of a force on the tool along a path, which a formula states.

    F_distance[tool] = a + b*s        a rope to a point of the world
    F_z[tool] = k*max(z0 - s, 0)      a soft floor
    F_motion[tool] = -c*ds**2         drag

`s` is the way along the path and `ds` its rate: a coordinate of the point of attachment in the
axes of the root, its distance from a point of the world, or no more than its speed. `x`, `y` and
`z` are its coordinates along any path. The joints feel the force by the principle of virtual work,
`tau_x = F ds/dv`.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence

import numpy as np

from sgp_ros.physics.formula import Formula
from sgp_ros.physics.law import FormulaLaw
from sgp_ros.physics.motion import SeenMotion, Structure
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.place import PLACES, TOOL, Place, Placed

AXES = ('x', 'y', 'z')
DISTANCE, MOTION = 'distance', 'motion'
PATHS = (*AXES, DISTANCE, MOTION)
"""Along an axis of the root, away from a point of the world, and along the motion itself."""
ATTACHED, ANCHOR = ('ax', 'ay', 'az'), ('px', 'py', 'pz')
"""Point of attachment in the frame of the link that carries the tool, and that of the world in the
axes of the root [m]."""
WAY, RATE = 's', 'ds'
UNITS = dict.fromkeys((WAY, *AXES), 'm') | {RATE: 'm/s'}
"""Names in a formula that are no parameters, with their units."""
STATED = re.compile(r'\s*F_(\w+)\[tool\]\s*')
"""Left side of the formula of a law of the tool."""
_STILL = 1e-9
"""Speed or distance beneath which a direction has no meaning [m/s or m]."""
_RADII = 4
"""Distances of points of the world that are tried, from half the motion to far away."""


class ToolLaw(FormulaLaw):
    """A law of a force on the tool along a path.

    Args:
        formula: of the force, in the way `s` and its rate `ds`.
        path: of `PATHS`.
        parameters: of the formula, `ATTACHED`, and `ANCHOR` of a distance.
        words: for people.
        is_open: whether a robot may have it or not, and its numbers are not known.
        price: what the choice of its formula among others takes [nats].
    """

    site = TOOL

    def __init__(
        self, formula: Formula, path: str, parameters: Sequence[LawParameter],
        words: str = 'a force on the tool', *, is_open: bool = False, price: float = 0.0,
    ) -> None:  # fmt: skip
        super().__init__(formula, TOOL.value, parameters, words, is_open=is_open, price=price)
        self.path, self.formula = path, f'F_{path}[{TOOL.value}] = {formula.text}'
        self.has_chosen_form = is_open

    def surprise(self, at: Placed) -> float:
        """Return the price of its formula and of a point far from the tool, or off the link.

        That has a normal prior around the tool, with an eighth of the range that is searched.
        """
        numbers = self.shape_numbers(at.shape)
        off = ((numbers[n] - p.start) / (p.high - p.low) for n, p in self._own.items()
               if n in ATTACHED and not p.is_known)  # fmt: skip
        return super().surprise(at) + 32.0 * sum(x * x for x in off)

    @staticmethod
    def point_names(path: str) -> tuple[str, ...]:
        """Return the parameters of a path that are no parts of the formula."""
        return (*ATTACHED, *ANCHOR) if path == DISTANCE else ATTACHED

    def places(self, motion: SeenMotion) -> list[Place]:
        """Return the tool, where one link carries it."""
        return [] if motion.tool is None else [Place(PLACES[TOOL.value])]

    def starts(self, motion: SeenMotion, place: Place) -> np.ndarray:
        """Return starts of its numbers, and places of the world all around that are not known."""
        names = self.shape_names()
        own = [n for n in names if n not in {*ATTACHED, *ANCHOR}]
        first = np.array([self._own[n].start for n in names])
        anchors = [dict[str, float]()]
        if self.is_open and set(ANCHOR) <= set(names):
            anchors += [dict(zip(ANCHOR, x, strict=True)) for x in _around(motion).tolist()]
        grid = itertools.product(*(self.values_of(n) for n in own))
        found = [
            [(anchor | dict(zip(own, numbers, strict=True))).get(n, x)
             for n, x in zip(names, first.tolist(), strict=True)]
            for numbers in grid for anchor in anchors
        ]  # fmt: skip
        return np.array(found).reshape(len(found), len(names))

    def scales(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the distance of a point of the world, and the size of the link for its own."""
        usual = super().scales(motion, place, shape)
        names, numbers = self.shape_names(), self.shape_numbers(shape)
        far = np.inf
        if self.path == DISTANCE:
            far = max(float(self._way(motion, numbers)[0].mean()), _STILL)
        return np.array([min(x, far) if n in ANCHOR else x
                         for n, x in zip(names, usual, strict=True)])  # fmt: skip

    def columns(self, motion: SeenMotion, place: Place, shape: np.ndarray) -> np.ndarray:
        """Return the efforts per factor, (n, k, m)."""
        numbers = self.shape_numbers(shape)
        _, efforts, F = self._force(motion, numbers)
        return efforts[:, :, None] * F[:, None, :]

    def _force(
        self, motion: SeenMotion, numbers: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return way (n,), efforts of a unit force (n, k), and force per factor (n, m)."""
        assert motion.tool is not None
        way, rate, efforts = self._way(motion, numbers)
        place = motion.tool.points(np.array([numbers[n] for n in ATTACHED]))
        seen = {WAY: way, RATE: rate} | dict(zip(AXES, place.T, strict=True))
        return way, efforts, self.per_factor(motion, {**numbers, **seen})

    def _way(
        self, motion: SeenMotion, numbers: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return way (n,), rate (n,), and efforts of a unit force along it (n, k)."""
        assert motion.tool is not None
        at = np.array([numbers[n] for n in ATTACHED])
        J = motion.tool.columns(at)
        v = np.einsum('nkx,nk->nx', J, motion.velocity)
        if self.path in AXES:
            i = AXES.index(self.path)
            return motion.tool.points(at)[:, i], v[:, i], J[:, :, i]
        along = v
        if self.path == DISTANCE:
            along = motion.tool.points(at) - np.array([numbers[n] for n in ANCHOR])
        size = np.linalg.norm(along, axis=1)
        along = along / np.maximum(size, _STILL)[:, None]
        return size, np.einsum('nx,nx->n', v, along), np.einsum('nkx,nx->nk', J, along)

    def sentence(self, at: Placed, motion: SeenMotion) -> str:
        """Return what the force is, where it acts, and how large it was over the way it saw."""
        numbers = self.shape_numbers(at.shape)
        way, _, factors = self._force(motion, numbers)
        force = factors @ at.coefficients
        name, unit = (RATE, UNITS[RATE]) if self.path == MOTION else (WAY, UNITS[WAY])
        first, last = (float(force[i]) + 0.0 for i in (np.argmin(way), np.argmax(way)))
        where = ', '.join(f'{numbers[n]:.3g}' for n in ATTACHED)
        meant = {MOTION: 'its speed; a negative force brakes it'}
        if self.path == DISTANCE:
            anchor = ', '.join(f'{numbers[n]:.3g}' for n in ANCHOR)
            meant[DISTANCE] = (
                f'its distance from the point ({anchor}) m in the axes of the base; a negative '
                'force pulls it there'
            )
        said = meant.get(self.path, f'its {self.path} in the axes of the base')
        return (
            f'The force on the tool is that of {self.words}. It acts on the point ({where}) m of '
            f'the link that carries the tool. {name} is {said}: {first:.3g} N at {way.min():.3g} '
            f'{unit}, {last:.3g} N at {way.max():.3g} {unit}.'
        )

    def _holds(self) -> bool:
        """Return False: what drags along the motion is no dry friction of a joint."""
        return False


def _around(motion: SeenMotion) -> np.ndarray:
    """Return points all around the middle of what the tool has seen, (p, 3) [m]."""
    seen = tool_seen(motion)
    grid = itertools.product((-1.0, 0.0, 1.0), repeat=3)
    ways = np.array([x / np.linalg.norm(x) for x in map(np.array, grid) if x.any()])
    near, far = 0.5 * float(np.ptp(seen, axis=0).max()), 4.0 * tool_reach(motion)
    radii = np.geomspace(max(near, 1e-3 * far), far, _RADII)
    return np.concatenate([seen.mean(axis=0) + r * ways for r in radii])


def tool_point(tree: Structure) -> np.ndarray:
    """Return where the tool is on its link: `tool0`, else the centre of mass, (3,) [m]."""
    if tree.tool is not None:
        return tree.tool.translation
    body = tree.parameters[tree.tool_body]
    return np.asarray(body[1:4] / max(float(body[0]), 1e-9))


def tool_seen(motion: SeenMotion) -> np.ndarray:
    """Return where the tool is, (n, 3) [m]."""
    assert motion.tool is not None
    return motion.tool.points(tool_point(motion.tree))


def tool_reach(motion: SeenMotion) -> float:
    """Return how far the tool gets from the root, or moves [m]."""
    seen = tool_seen(motion)
    return float(max(np.linalg.norm(seen, axis=1).max(), np.ptp(seen, axis=0).max(), 1e-3))
