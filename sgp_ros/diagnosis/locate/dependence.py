"""On which variables the discrepancy of a joint depends, judged on stretches left out.

The discrepancy is averaged over bins of each variable, apart for both directions of motion, on
five sixths of the time; the score is the share of its mean square that the averages explain on
the last sixth, over all six.

Slow noise has scores too, and the best of many is high by chance. So each score is set against
those of disturbances with the same spectra (`surrogates`), by the logarithm of what is left
unexplained, in standard deviations of these. Its p-value is the share of disturbances of which
the best over all joints and variables reaches that far (Westfall and Young 1993, section 2.3): 5 %
is 5 % for all of them together. The logarithm, because with a motion that repeats most of such a
disturbance is explained too, and only what is left tells one law from another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.shown import Dependence


def surrogates(residual: np.ndarray, count: int) -> Iterator[np.ndarray]:
    """Yield `count` disturbances like a residual (N, k), (N, k) each; always the same ones.

    Cost O(N k log N) each.
    """
    rng = np.random.default_rng(0)
    n = len(residual)
    spectrum = np.fft.rfft(residual, axis=0)
    for _ in range(count):
        turns = np.exp(2j * np.pi * rng.random(len(spectrum)))
        turns[0] = 1.0
        if n % 2 == 0:
            turns[-1] = rng.choice([-1.0, 1.0])
        yield np.fft.irfft(spectrum * turns[:, None], n, axis=0)


def own_variables(equations: Equations, joint: int) -> dict[str, np.ndarray]:
    """Return position, velocity, effort and time of a joint, (N,) each.

    Positions of continuous joints are wrapped [rad or m]; velocity [rad/s or m/s]; the effort
    where it is a command [N m or N]; time since the first state [s].
    """
    motion, low = equations.motion, equations.filter
    variables = {
        'position': motion.wrapped[low.rows, joint],
        'velocity': low(motion.velocity[:, joint]),
    }
    if motion.is_commanded[joint]:
        variables['effort'] = low(motion.effort[:, joint])
    return variables | {'time': equations.time}


BINS, STRETCHES, PARTS = 16, 24, 6
LEAST_COUNT = 3
"""A bin with no more rows than these predicts nothing."""
LEAST_LEFT = 1e-6
"""Share left unexplained below which no difference is made."""
DISTURBANCES = 199
"""The least p-value is one in `DISTURBANCES` and one."""


@dataclass(frozen=True, eq=False)
class _Look:
    """One variable of one joint: which rows fall into which bin and which part.

    Attributes:
        joint: index.
        variable: name.
        cell: (N,) part, bin and direction in one number.
        count: (PARTS, 2 BINS) rows.
    """

    joint: int
    variable: str
    cell: np.ndarray
    count: np.ndarray

    def score(self, r: np.ndarray) -> float:
        """Return the share of r (N,) that is explained; negative where the averages do harm.

        From the sums of each part and bin alone: O(N) with a small constant.
        """
        power = float(r @ r)
        if power <= 0.0:
            return 0.0
        size = self.count.size
        total = np.bincount(self.cell, weights=r, minlength=size).reshape(self.count.shape)
        known = self.count.sum(axis=0) - self.count
        rest = total.sum(axis=0) - total
        mean = np.where(known > LEAST_COUNT, rest / np.maximum(known, 1), 0.0)
        return float((2.0 * mean * total - mean**2 * self.count).sum()) / power


def dependences(equations: Equations, residual: np.ndarray) -> tuple[Dependence, ...]:
    """Return the dependence of each joint's discrepancy (N, k) on the motion [N m or N].

    Cost O(`DISTURBANCES` N k^2).
    """
    names = equations.motion.tree.moving_names
    looks = _looks(equations)
    found = np.array([look.score(residual[:, look.joint]) for look in looks])
    chances = _p_values(looks, found, residual)
    share = (residual**2).mean(axis=0) / equations.power
    result = []
    for j, name in enumerate(names):
        of = [i for i, look in enumerate(looks) if look.joint == j]
        scores = {looks[i].variable: max(0.0, float(found[i])) for i in of}
        p_values = {looks[i].variable: float(chances[i]) for i in of}
        result.append(Dependence(name, float(share[j]), scores, p_values))
    return tuple(result)


def _p_values(looks: list[_Look], found: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the chance of each score as the best of all looks, (looks,)."""
    by_chance = np.array(
        [
            [look.score(r[:, look.joint]) for look in looks]
            for r in surrogates(residual, DISTURBANCES)
        ]
    )
    by_chance, found = (-np.log(np.maximum(1.0 - s, LEAST_LEFT)) for s in (by_chance, found))
    mean, spread = by_chance.mean(axis=0), by_chance.std(axis=0)
    spread = np.maximum(spread, 1e-9)
    best = ((by_chance - mean) / spread).max(axis=1)
    reached = (best[:, None] >= (found - mean) / spread).sum(axis=0)
    return np.asarray((1.0 + reached) / (1.0 + DISTURBANCES))


def _looks(equations: Equations) -> list[_Look]:
    names = equations.motion.tree.moving_names
    own = [own_variables(equations, j) for j in range(len(names))]
    looks = []
    for j in range(len(names)):
        variables = {name: x for name, x in own[j].items() if name != 'time'}
        for i, other in enumerate(names):
            if i != j:
                variables[f'position of {other}'] = own[i]['position']
                variables[f'velocity of {other}'] = own[i]['velocity']
        variables['time'] = own[j]['time']
        forward = own[j]['velocity'] > 0.0
        looks += [_look(j, variable, x, forward) for variable, x in variables.items()]
    return looks


def _look(joint: int, variable: str, x: np.ndarray, forward: np.ndarray) -> _Look:
    edges = np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)[1:-1])
    # neighbours in time do not test dependence on time: leave out every other half bin
    stretches = PARTS * BINS if variable == 'time' else STRETCHES
    part = (np.arange(len(x)) * stretches // len(x)) % PARTS
    cell = (part * BINS + np.searchsorted(edges, x)) * 2 + forward
    shape = PARTS, 2 * BINS
    return _Look(
        joint, variable, cell, np.bincount(cell, minlength=2 * BINS * PARTS).reshape(shape)
    )
