"""A quick look at every effect, place and shape, given the model so far.

A trial costs a few products: with B an orthonormal basis of what bodies and effects explain, r
what they leave, and x the columns of the trial, of which only the rows of one joint differ from
zero, `|r - (x - B B^T x) c|^2` follows for each joint from `x^T x`, `B^T x`, `x^T r` and the
products of B with itself and with r, joint by joint. O(N P) per column for P columns of B,
instead of O(N k P).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
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
WIDEST = 0.75
"""Widest interval of position, as a share of the range: wider ones are no region."""

_UNSEEN = 1e-13
"""Part of a column's square below which it counts as explained."""

Trial = tuple[float, EffectAt]


def screen(
    columns: Columns,
    model: Model,
    effects: Iterable[Effect],
    joints: Collection[int] | None = None,
) -> list[Trial]:
    """Return candidates with the gain in score they promise, best first.

    Args:
        columns: of the recording.
        model: so far.
        effects: that could be added.
        joints: indices of the places that are looked at; None for all.
    """
    held = dry_joints(model.effects)
    rests = {held: _Rest.of(columns, model, held)}
    before = rests[held].left
    found: list[Trial] = []
    for effect in effects:
        if effect.is_body and model.is_free:
            continue
        for place in _free_places(effect, model, columns.equations(held).motion):
            if joints is not None and place.joint not in joints:
                continue
            if not shows(effect, place, columns.equations(held).motion):
                continue
            dry = held | effect.held_joints(place)
            if dry not in rests:
                rests[dry] = _Rest.of(columns, model, dry)
            motion = columns.corrected(model.w if effect.uses_bodies else None)
            trials = _trials(_Look(columns, rests[dry], before), effect, place, motion)
            if place.number:
                trials = (t for t in trials if are_apart((*model.effects, t[1]), motion))
            found += sorted(trials, key=lambda t: -t[0])[:TRIALS]
    return sorted(found, key=lambda t: -t[0])


def _free_places(effect: Effect, model: Model, motion: ObservedMotion) -> Iterator[Place]:
    """Yield the places of a law that a model has not there yet; of a wave further ones too."""
    for place in effect.places(motion):
        here = [s.place.number for s in model.effects if _is_like(s, effect, place)]
        if not here:
            yield place
        elif effect.wave(motion, place) is not None:
            yield replace(place, number=1 + max(here))


def _is_like(s: EffectAt, effect: Effect, place: Place) -> bool:
    """Return whether an effect is one of a law at a place, of which waves may have several."""
    return s.effect is effect and replace(s.place, number=0) == place


def are_apart(effects: Sequence[EffectAt], motion: ObservedMotion) -> bool:
    """Return whether waves of one law at one place differ by one period or more in the motion."""
    for i, s in enumerate(effects):
        first = replace(s.place, number=0)
        others = [o for o in effects[:i] if _is_like(o, s.effect, first)]
        wave = s.effect.wave(motion, s.place) if others else None
        if wave and any(abs(o.shape[0] - s.shape[0]) < wave.width for o in others):
            return False
    return True


@dataclass(frozen=True, eq=False)
class _Rest:
    """What a model leaves, in one frame, with products of the basis B of what it explains.

    Attributes:
        frame: scaled equations.
        r: (N, k) residual.
        B: (N, k, P) orthonormal together with the rows of the prior.
        BB: (k, P, P) products of the basis with itself, joint by joint.
        Br: (k, P) products of the basis and the residual, joint by joint.
    """

    frame: Frame
    r: np.ndarray
    B: np.ndarray
    BB: np.ndarray
    Br: np.ndarray

    @classmethod
    def of(cls, columns: Columns, model: Model, dry: frozenset[int]) -> _Rest:
        frame = Frame.of(columns.equations(dry), model.sigma, is_free=model.is_free)
        y, A, _ = split(frame, columns, model.effects, model.w)
        basis = frame.Q
        if A.shape[1]:
            own = np.linalg.qr(A / np.sqrt((A * A).sum(axis=0) + 1e-300))[0]
            y = y - own @ (own.T @ y)
            basis = np.concatenate([basis, own], axis=1)
        N, k = frame.equations.d.shape
        r, B = y[: N * k].reshape(N, k), basis[: N * k].reshape(N, k, -1)
        BB = np.stack([B[:, j].T @ B[:, j] for j in range(k)])
        return cls(frame, r, B, BB, np.einsum('nkp,nk->kp', B, r))

    @property
    def equations(self) -> Equations:
        return self.frame.equations

    @property
    def left(self) -> np.ndarray:
        """Mean squares of the residual, (k,) [N^2 m^2 or N^2]."""
        return np.asarray((self.r**2).mean(axis=0) * self.frame.sigma**2)


@dataclass(frozen=True, eq=False)
class _Products:
    """Products of columns, less what the model explains of them, with themselves and the residual.

    Attributes:
        own: (k, m, m), joint by joint.
        cross: (k, m) with the residual, joint by joint.
        G: (m, m) over all rows.
        b: (m,) with the residual over all rows.
    """

    own: np.ndarray
    cross: np.ndarray
    G: np.ndarray
    b: np.ndarray

    @classmethod
    def of(cls, rest: _Rest, filtered: np.ndarray, joint: int) -> _Products:
        """Return those of filtered columns (N, m) of one joint, or (N, k, m)."""
        sigma, N, m = rest.frame.sigma, len(filtered), filtered.shape[-1]
        k, P = rest.Br.shape
        Bx, xx, xr = np.zeros((k, P, m)), np.zeros((k, m, m)), np.zeros((k, m))
        for j in range(k) if filtered.ndim == 3 else (joint,):
            x = (filtered.reshape(N, -1, m)[:, j if filtered.ndim == 3 else 0]) / sigma[j]
            Bx[j], xx[j], xr[j] = rest.B[:, j].T @ x, x.T @ x, x.T @ rest.r[:, j]
        u = Bx.sum(axis=0)  # (P, m)
        shared = Bx.transpose(0, 2, 1) @ u  # (k, m, m)
        own = xx - shared - shared.transpose(0, 2, 1) + u.T @ (rest.BB @ u)
        G = xx.sum(axis=0) - u.T @ u
        G[np.diag_indices(m)] = np.where(
            np.diag(G) > _UNSEEN * np.diag(xx.sum(axis=0)), np.diag(G), np.inf
        )
        return cls(own, xr - rest.Br @ u, G, xr.sum(axis=0))

    def coefficients(self) -> np.ndarray:
        """Return the least squares (m,); zero for columns that are explained already."""
        size = np.sqrt(np.diag(self.G))
        G = np.where(np.isfinite(self.G), self.G, 0.0) / np.outer(size, size)
        G[np.diag_indices(len(size))] = np.isfinite(size)
        return np.asarray(np.linalg.lstsq(G, self.b / size, rcond=_UNSEEN)[0] / size)


@dataclass(frozen=True, eq=False)
class _Look:
    """Trials beside a model that leaves the mean squares `before` (k,)."""

    columns: Columns
    rest: _Rest
    before: np.ndarray

    def products(self, candidate: EffectAt, motion: ObservedMotion) -> _Products | None:
        """Return those of a candidate's columns; None where it has none."""
        x = self.columns.local(candidate, self.rest.equations, motion)
        return _Products.of(self.rest, x, candidate.place.joint) if x.shape[-1] else None

    def gain(self, found: _Products, c: np.ndarray, size: int) -> float:
        """Return how much better columns with coefficients c (m,) leave it [nats]."""
        rest = self.rest
        N, floor = len(rest.r), floors(rest.equations)
        change = np.einsum('m,kml,l->k', c, found.own, c) - 2.0 * found.cross @ c
        after = np.maximum(rest.left + change / N * rest.frame.sigma**2, 0.0)
        ratio = (self.before + floor) / (after + floor)
        return 0.5 * N * float(np.log(ratio).sum()) - 0.5 * size * float(np.log(N))


def _trials(look: _Look, effect: Effect, place: Place, motion: ObservedMotion) -> Iterator[Trial]:
    bins = effect.bins(look.rest.equations.motion, place)
    if bins is not None:
        yield from _intervals(look, EffectAt(effect, place), bins)
        return
    for shape in _starts(look.rest, effect, place):
        trial = _trial(look, EffectAt(effect, place, shape), motion)
        if trial is not None:
            yield trial


def _starts(rest: _Rest, effect: Effect, place: Place) -> np.ndarray:
    """Return the shapes that are tried; the periods of a wave are where the residual has them."""
    equations = rest.equations
    wave = effect.wave(equations.motion, place)
    if wave is None:
        return effect.starts(equations.motion, place)
    return wave.strongest(equations.filter.rows, rest.r, rest.frame.sigma)


def _trial(look: _Look, candidate: EffectAt, motion: ObservedMotion) -> Trial | None:
    effect = candidate.effect
    if effect.small is not None:
        return _small_trial(look, candidate, effect.small, motion)
    found = look.products(candidate, motion)
    if found is None:
        return None
    c = found.coefficients()
    if effect.is_given:
        # a start may have the wrong size, not the wrong sign
        if c[0] <= 0.0:
            return None
    elif not replace(candidate, coefficients=c).is_possible(motion):
        return None
    return look.gain(found, c, len(c) + len(candidate.shape)), candidate


def _small_trial(
    look: _Look, start: EffectAt, small: SmallEffect, motion: ObservedMotion
) -> Trial | None:
    """Return the trial of an effect that is linear in its size while it is small."""
    raw = small.columns(motion, start.place, start.shape)
    x = look.rest.equations.compact(raw, start.place.joint, is_inertial=False)
    found = _Products.of(look.rest, x, start.place.joint)
    c = found.coefficients()
    shape = small.shape(start.shape, c)
    placed = start.with_shape(shape)
    if not placed.is_possible(motion):
        return None
    return look.gain(found, c, len(shape)), placed


def _intervals(
    look: _Look, candidate: EffectAt, bins: tuple[np.ndarray, np.ndarray]
) -> Iterator[Trial]:
    """Yield the best interval, and the best that is not its neighbour.

    With the columns of narrow bins and their Gram matrix every interval costs a few sums.
    """
    columns, edges = bins
    joint = candidate.place.joint
    x = look.rest.equations.compact(columns, joint, is_inertial=False)
    found = _Products.of(look.rest, x, joint)
    G = np.where(np.isfinite(found.G), found.G, 0.0)
    i, j = np.triu_indices(len(edges), 1)
    area = np.zeros((len(edges), len(edges)))
    area[1:, 1:] = np.cumsum(np.cumsum(G, axis=0), axis=1)
    size = area[j, j] - area[i, j] - area[j, i] + area[i, i]
    sums = np.concatenate([[0.0], np.cumsum(found.b)])
    push = sums[j] - sums[i]
    usable = (push > 0.0) & (j - i <= WIDEST * columns.shape[1]) & (size > 1e-12 * area[-1, -1])
    gain = np.where(usable, push**2 / np.maximum(size, 1e-300), 0.0)
    order = np.argsort(-gain)
    far = (abs(i[order] - i[order[0]]) > TRIALS * 2) | (abs(j[order] - j[order[0]]) > TRIALS * 2)
    for best in (order[0], order[int(np.argmax(far))]):
        if gain[best] > 0.0:
            c = np.zeros(columns.shape[1])
            c[i[best] : j[best]] = push[best] / size[best]
            shape = np.array([edges[i[best]], edges[j[best]]])
            yield look.gain(found, c, 3), candidate.with_shape(shape)
