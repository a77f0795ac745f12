"""A quick look at every effect, place and shape, given the model so far."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.settled import shows
from sgp_ros.diagnosis.explain.candidates import split
from sgp_ros.diagnosis.explain.fitted_model import Model, floors
from sgp_ros.diagnosis.explain.regression import Columns, Frame, dry_joints
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Place, SmallEffect
from sgp_ros.robots.observed_motion import ObservedMotion

TRIALS = 2
"""Shapes per effect and place that are worth a fit."""
_WIDEST = 0.75
"""Widest interval of position, as a share of the range: wider ones are no region."""

Trial = tuple[float, EffectAt]


def screen(columns: Columns, model: Model, effects: Iterable[Effect]) -> list[Trial]:
    """Return candidates with the gain in score they promise, best first."""
    held = dry_joints(model.effects)
    rests = {held: _Rest.of(columns, model, held)}
    before = rests[held].frame.by_joint(rests[held].y)
    known = {s.key for s in model.effects}
    found: list[Trial] = []
    for effect in effects:
        if effect.is_body and model.is_free:
            continue
        for place in effect.places(columns.equations(held).motion):
            if (effect.name, place) in known:
                continue
            if not shows(effect, place, columns.equations(held).motion):
                continue
            dry = held | effect.held_joints(place)
            if dry not in rests:
                rests[dry] = _Rest.of(columns, model, dry)
            motion = columns.corrected(model.w if effect.uses_bodies else None)
            trials = _trials(rests[dry], effect, place, motion, before)
            found += sorted(trials, key=lambda t: -t[0])[:TRIALS]
    return sorted(found, key=lambda t: -t[0])


@dataclass(frozen=True, eq=False)
class _Rest:
    """What a model leaves, in one frame: the residual and an orthonormal basis of its columns."""

    frame: Frame
    y: np.ndarray
    basis: np.ndarray | None

    @classmethod
    def of(cls, columns: Columns, model: Model, dry: frozenset[int]) -> _Rest:
        frame = Frame.of(columns.equations(dry), model.sigma, is_free=model.is_free)
        y, A, _ = split(frame, columns, model.effects, model.w)
        if not A.shape[1]:
            return cls(frame, y, None)
        basis = np.linalg.qr(A / np.sqrt((A * A).sum(axis=0) + 1e-300))[0]
        return cls(frame, y - basis @ (basis.T @ y), basis)

    @property
    def equations(self) -> Equations:
        return self.frame.equations

    def apart(self, raw: np.ndarray, place: Place, *, is_inertial: bool = False) -> np.ndarray:
        """Return what the model so far leaves of columns at the full rate, (N k + p, m)."""
        filtered = self.equations.filtered(raw, place.joint, is_inertial=is_inertial)
        x = self.frame.projected(filtered)
        return x if self.basis is None else x - self.basis @ (self.basis.T @ x)

    def gain(self, residual: np.ndarray, before: np.ndarray, size: int) -> float:
        """Return how much better a residual is than the mean squares `before` (k,) [nats]."""
        N = len(self.equations.d)
        floor = floors(self.equations)
        ratio = (before + floor) / (self.frame.by_joint(residual) + floor)
        return 0.5 * N * float(np.log(ratio).sum()) - 0.5 * size * float(np.log(N))


def _trials(
    rest: _Rest, effect: Effect, place: Place, motion: ObservedMotion, before: np.ndarray
) -> Iterator[Trial]:
    bins = effect.bins(rest.equations.motion, place)
    if bins is not None:
        yield from _intervals(rest, EffectAt(effect, place), bins, before)
        return
    for shape in _starts(rest, effect, place):
        trial = _trial(rest, EffectAt(effect, place, shape), motion, before)
        if trial is not None:
            yield trial


def _starts(rest: _Rest, effect: Effect, place: Place) -> np.ndarray:
    """Return the shapes that are tried; the periods of a wave are where the residual has them."""
    equations = rest.equations
    wave = effect.wave(equations.motion, place)
    if wave is None:
        return effect.starts(equations.motion, place)
    residual = rest.y[: equations.d.size].reshape(equations.d.shape)
    return wave.strongest(equations.filter.rows, residual, rest.frame.sigma)


def _trial(
    rest: _Rest, candidate: EffectAt, motion: ObservedMotion, before: np.ndarray
) -> Trial | None:
    effect = candidate.effect
    if effect.small is not None:
        return _small_trial(rest, candidate, effect.small, motion, before)
    raw = candidate.columns(motion)
    if raw.shape[-1] == 0:
        return None
    x = rest.apart(raw, candidate.place, is_inertial=effect.is_inertial)
    scale = np.sqrt((x * x).sum(axis=0)) + 1e-300
    c = np.linalg.lstsq(x / scale, rest.y, rcond=1e-7)[0] / scale
    if effect.is_given:
        # a start may have the wrong size, not the wrong sign
        if c[0] <= 0.0:
            return None
    elif not replace(candidate, coefficients=c).is_possible(motion):
        return None
    return rest.gain(rest.y - x @ c, before, len(c) + len(candidate.shape)), candidate


def _small_trial(
    rest: _Rest, start: EffectAt, small: SmallEffect, motion: ObservedMotion, before: np.ndarray
) -> Trial | None:
    """Return the trial of an effect that is linear in its size while it is small."""
    x = rest.apart(small.columns(motion, start.place, start.shape), start.place)
    scale = np.sqrt((x * x).sum(axis=0)) + 1e-300
    c = np.linalg.lstsq(x / scale, rest.y, rcond=1e-7)[0] / scale
    shape = small.shape(start.shape, c)
    found = start.with_shape(shape)
    if not found.is_possible(motion):
        return None
    return rest.gain(rest.y - x @ c, before, len(shape)), found


def _intervals(
    rest: _Rest, candidate: EffectAt, bins: tuple[np.ndarray, np.ndarray], before: np.ndarray
) -> Iterator[Trial]:
    """Yield the best interval, and the best that is not its neighbour.

    With the columns of narrow bins and their Gram matrix every interval costs a few sums.
    """
    columns, edges = bins
    x = rest.apart(columns, candidate.place)
    i, j = np.triu_indices(len(edges), 1)
    area = np.zeros((len(edges), len(edges)))
    area[1:, 1:] = np.cumsum(np.cumsum(x.T @ x, axis=0), axis=1)
    size = area[j, j] - area[i, j] - area[j, i] + area[i, i]
    sums = np.concatenate([[0.0], np.cumsum(x.T @ rest.y)])
    push = sums[j] - sums[i]
    usable = (push > 0.0) & (j - i <= _WIDEST * columns.shape[1]) & (size > 1e-12 * area[-1, -1])
    gain = np.where(usable, push**2 / np.maximum(size, 1e-300), 0.0)
    order = np.argsort(-gain)
    far = (abs(i[order] - i[order[0]]) > TRIALS * 2) | (abs(j[order] - j[order[0]]) > TRIALS * 2)
    for c in (order[0], order[int(np.argmax(far))]):
        if gain[c] > 0.0:
            column = x[:, i[c] : j[c]].sum(axis=1) * (push[c] / size[c])
            shape = np.array([edges[i[c]], edges[j[c]]])
            yield rest.gain(rest.y - column, before, 3), candidate.with_shape(shape)
