"""Search for errors of the connection, one after the other, as long as each is worth its price."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import optimize

from sgp_ros.diagnosis.criteria import COUNTED_SHARE, PER_EFFECT, PER_PARAMETER, SLIGHT_REST
from sgp_ros.diagnosis.setup.connection import Connection, Rivals, Tried, price_of_one, undoing
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.errors import Hypothesis, hypotheses
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.joint import Together, spread, value_of
from sgp_ros.diagnosis.setup.unknowns import SUDDEN, Agreement

_REFINED = 6
"""Hypotheses of which the numbers are searched to the end."""
_MOST = 4
_FINE = 1e-3
"""Accuracy of the numbers of one hypothesis [its first step]."""
_FAR = 300.0
"""Evidence that a start may lack and still be looked at [nats]."""


def search(probe: Probe) -> Connection:
    """Return the errors that explain what bodies and everyday friction do not.

    A delay of targets looks like other gains of every drive, so a search that adds errors one by
    one would not return to it: where a delay is worth its price, the search begins with it. If
    the result leaves a residual that counts as physics, a second search begins without it, and a
    third with a delay beside the gains that were found then, which may have hidden it.
    """
    none = Correction.none(probe.motion.tree.size)
    start = probe.agreement(none)
    chains: list[tuple[list[Tried], Rivals]] = []
    for h in hypotheses(probe.full):
        first = _physics(probe, h) if h.is_physics else None
        if first is not None and _gain(probe, first, none, start) > PER_EFFECT:
            chains.append(_grown(probe, [first], first.agreement))
    if all(c[-1].agreement.left.max() > COUNTED_SHARE for c, _ in chains):
        chains.append(_grown(probe, [], start))
        for delayed in _delayed(probe, chains[-1][0]):
            more, beside = _grown(probe, delayed, delayed[-1].agreement)
            chains.append((more, chains[-1][1] | beside))
    best, rivals = max(chains, key=lambda c: _worth(c[0], start))
    # physics beside them stays to be found
    errors = undoing([e for e in best if not e.hypothesis.is_physics])
    late = max((float(e.std[0]) for e in best if e.hypothesis.is_physics), default=0.0)
    end = best[-1].agreement if best else start
    others = tuple(rivals[e.hypothesis.key] for e in errors)
    return Connection(errors, others, start, end, late)


def _physics(probe: Probe, h: Hypothesis) -> Tried:
    """Return an effect of one number, searched from the starts with the least rest at each joint.

    With wrong gains at another joint, the evidence of all joints has its maximum elsewhere.
    """
    none = Correction.none(probe.motion.tree.size)
    left = np.array([probe.agreement(h.applied(none, x)).left for x in h.starts])  # (s, k)
    starts = h.starts[np.unique(left.argmin(axis=0))]
    return max((_refined(probe, none, h, x) for x in starts), key=lambda t: t.worth)


def _delayed(probe: Probe, errors: list[Tried]) -> list[list[Tried]]:
    """Return gains of drives with a delay beside them, with all numbers searched at once."""
    if not any(e.hypothesis.is_of_gains for e in errors):
        return []
    starts = [(h, x) for h in hypotheses(probe.full) if h.is_physics for x in h.starts]
    found = [_together(probe, [_tried(probe, h, x), *errors]) for h, x in starts]
    late = [f for f in found if f[0].hypothesis.is_physics]
    return sorted(late, key=lambda f: f[-1].agreement.evidence)[-1:]


def _tried(probe: Probe, h: Hypothesis, x: np.ndarray) -> Tried:
    correction = h.applied(Correction.none(probe.motion.tree.size), x)
    return Tried(h, x, np.zeros(len(x)), correction, probe.agreement(correction))


def _worth(errors: Sequence[Tried], start: Agreement) -> float:
    """Return the evidence with all errors undone less their prices [nats]."""
    return (errors[-1].agreement if errors else start).evidence - sum(map(_price, errors))


def _grown(
    probe: Probe, errors: list[Tried], now: Agreement
) -> tuple[list[Tried], Rivals]:  # fmt: skip
    """Return errors with those that are worth their price beside them, one after the other.

    With the rivals of those that were added.
    """
    rivals: Rivals = {}
    for _ in range(_MOST - len(errors)):
        correction = errors[-1].correction if errors else Correction.none(probe.motion.tree.size)
        is_late = any(e.hypothesis.is_physics for e in errors)
        ranked = _ranked(probe, correction, now, errors, is_beside_delay=is_late)
        if is_late:
            ranked = _beside(probe, errors, ranked)
        ranked = sorted(ranked, key=lambda t: _price(t) - t.agreement.evidence)
        if not ranked or _gain(probe, ranked[0], correction, now) <= 0.0:
            break
        rivals[ranked[0].hypothesis.key] = tuple(ranked[1:])
        errors = _together(probe, [*errors, ranked[0]]) if errors else ranked[:1]
        now = errors[-1].agreement
    return errors, rivals


def _gain(probe: Probe, tried: Tried, base: Correction, now: Agreement) -> float:
    """Return what an error is worth beyond its price, for the same errors of shape [nats].

    Friction that builds up lags as another clock would: this must be worth it beside friction
    that turns at once too.
    """
    nominal = np.minimum(tried.agreement.nominal, now.nominal)
    is_of_clock = tried.correction.clock != base.clock
    gains = []
    for unknowns in ((), (SUDDEN,)) if is_of_clock else ((),):
        both = [probe.agreement(c, *unknowns, nominal=nominal).evidence
                for c in (tried.correction, base)]  # fmt: skip
        gains.append(both[0] - both[1] - price_of_one(tried.hypothesis))
    return min(gains)


def _beside(probe: Probe, errors: Sequence[Tried], ranked: Sequence[Tried]) -> list[Tried]:
    """Return further errors with all numbers searched at once."""
    chains = [_chain(_joint(probe, [*errors, t]).best()) for t in ranked]
    return [c[-1] for c in chains if c[-1].agreement.distance(c[-2].agreement) > COUNTED_SHARE]


def _together(probe: Probe, errors: Sequence[Tried]) -> list[Tried]:
    """Return errors with all their numbers searched at once; the last one undoes all.

    An error is left out if the others, with their numbers searched anew, make it superfluous.
    """
    found = _joint(probe, errors).best()
    while True:
        fewer = [_without(found, i) for i in range(len(found.hypotheses))]
        needed = [found.evidence - f.evidence - price_of_one(h)
                  for f, h in zip(fewer, found.hypotheses, strict=True)]  # fmt: skip
        least = int(np.argmin(needed))
        if needed[least] >= 0.0 or len(fewer) == 1:
            break
        found = fewer[least]
    return [replace(e, needed=x) for e, x in zip(_chain(found), needed, strict=True)]


def _price(tried: Tried) -> float:
    """Return the price by which errors are chosen, that of their numbers twice [nats].

    What one number explains three nearly do, which then explain a small error beside it too.
    """
    return price_of_one(tried.hypothesis) + PER_PARAMETER * len(tried.numbers)


def _joint(probe: Probe, errors: Sequence[Tried]) -> Together:
    return Together(probe, *zip(*((e.hypothesis, e.numbers) for e in errors), strict=True))


def _without(found: Together, i: int) -> Together:
    """Return all but one of some errors, with their numbers searched anew."""
    fewer = (x[:i] + x[i + 1 :] for x in (found.hypotheses, found.numbers))
    return Together(found.probe, *fewer).best()  # type: ignore[arg-type]


def _chain(found: Together) -> list[Tried]:
    """Return errors with the corrections that undo them one after the other."""
    correction = Correction.none(found.probe.motion.tree.size)
    std, chain = found.std(), []
    for h, x, s in zip(found.hypotheses, found.numbers, std, strict=True):
        correction = h.applied(correction, x)
        chain.append(Tried(h, x, s, correction, found.probe.agreement(correction)))
    return chain


def _ranked(
    probe: Probe, base: Correction, now: Agreement, errors: Sequence[Tried], *,
    is_beside_delay: bool,
) -> list[Tried]:  # fmt: skip
    """Return the hypotheses that are worth most on top of a correction.

    They are looked at beside the unknowns that are best without them and those that most robots
    have. Left out are those that change less than what is slight, and those of sampling. One that
    is too small for physics is still an error, and bodies would stand for it.
    """
    known, beside = [e.hypothesis.key for e in errors], {now.unknowns, probe.most_usual}
    screened = []
    for h in hypotheses(probe.full):
        if h.key in known:
            continue
        values = [value_of(probe, base, h, x, *beside) for x in h.starts]
        best = int(np.argmax(values))
        value, x = values[best], h.starts[best]
        if len(x) and value > now.evidence - _FAR:
            x = _parabola(probe, base, h, x, *beside)
            value = max(value, value_of(probe, base, h, x, *beside))
        screened.append((value, h, x))
    screened = sorted((s for s in screened if s[0] > -math.inf), key=lambda s: -s[0])
    if is_beside_delay:  # with other numbers of the delay, gains are others too
        drives = [s for s in screened[_REFINED:] if s[1].is_of_gains]
        return [_refined(probe, base, h, x, *beside) for _, h, x in screened[:_REFINED] + drives]
    found = [_refined(probe, base, h, x, *beside) for _, h, x in screened[:_REFINED]]
    return [t for t in found if t.agreement.distance(now) > SLIGHT_REST and t.is_beyond
            and t.agreement.leaves_less(now)]  # fmt: skip


def _parabola(
    probe: Probe, base: Correction, h: Hypothesis, x: np.ndarray, *unknowns: int
) -> np.ndarray:
    """Return x after one step to the vertex along each number, where that is better."""
    x = x.copy()
    for i, step in enumerate(h.steps_at(x)):
        e = np.zeros(len(x))
        e[i] = step
        low, mid, high = (value_of(probe, base, h, x + s * e, *unknowns) for s in (-1.0, 0.0, 1.0))
        bend = low - 2.0 * mid + high
        move = 0.5 * (low - high) / bend if bend < 0.0 else float(np.sign(high - low))
        trial = x + np.clip(move, -3.0, 3.0) * e
        if value_of(probe, base, h, trial, *unknowns) > mid:
            x = trial
    return x


def _refined(
    probe: Probe, base: Correction, h: Hypothesis, start: np.ndarray, *unknowns: int
) -> Tried:
    """Return a hypothesis with its best numbers; 0 for numbers that change nothing.

    They are searched beside some sets of unknowns, or beside all if another one is best then.
    """
    m, steps = len(start), h.steps_at(start)
    x, std = start, np.zeros(m)
    if m:
        found = optimize.minimize(
            lambda y: -value_of(probe, base, h, start + steps * y, *unknowns), np.zeros(m),
            method='Nelder-Mead', options={
                'initial_simplex': np.eye(m + 1, m, -1), 'maxfev': 45 * m, 'xatol': _FINE,
                'fatol': 0.02,
            },
        )  # fmt: skip
        x = h.canonical(start + steps * found.x)
        std = spread(probe, base, h, x)
        is_known = np.isfinite(std)
        x = np.where(is_known, x, h.neutral)
        x = _of_a_unit(probe, base, h, x) if is_known.all() else x
    correction = h.applied(base, x)
    tried = Tried(h, x, std, correction, probe.agreement(correction))
    is_best = not unknowns or tried.agreement.unknowns in unknowns
    return tried if is_best else _refined(probe, base, h, start)


def _of_a_unit(probe: Probe, base: Correction, h: Hypothesis, x: np.ndarray) -> np.ndarray:
    """Return the number of a unit that fits as well as x, less the price of a number, or x."""
    units = [np.array([unit]) for unit in h.exact]
    best = max(units, key=lambda unit: value_of(probe, base, h, unit), default=x)
    is_as_good = value_of(probe, base, h, best) > value_of(probe, base, h, x) - PER_PARAMETER
    return best if is_as_good else x
