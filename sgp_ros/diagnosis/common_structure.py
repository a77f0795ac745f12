"""One structure of laws for two recordings: those of a machine and of its simulation."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.scale import Scale
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import Model, first_scale
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.unlisted.beside import PLAIN
from sgp_ros.physics.effect_at import EffectAt, one_of_each
from sgp_ros.physics.place import Place
from sgp_ros.robots.observed_motion import ObservedMotion

_STEPS = 8
Estimates = dict[tuple[str, Place], tuple[EffectAt, Mapping[str, float]]]


@dataclass(frozen=True, eq=False)
class Side:
    """One recording with its models.

    Attributes:
        equations: of what is learned from.
        scale: of mean squares.
        columns: of candidates.
        named: effects that are asserted on it alone.
    """

    equations: Equations
    scale: Scale
    columns: Columns
    named: tuple[EffectAt, ...]

    @classmethod
    def of(cls, equations: Equations, several: Several) -> Side:
        """Return the recording with the effects that are asserted on it."""
        model = several.decision.model
        scale = Scale.of(equations, several.comparison)
        return cls(equations, scale, Columns(equations), model.effects)

    def fitted(self, effects: tuple[EffectAt, ...], *, is_free: bool) -> Model:
        """Return a model of effects.

        The shapes of those that are not named here stay, but where a shape is the only size.
        """
        start, own = first_scale(self.equations), {s.key: s for s in self.named}
        others = tuple(s for s in effects if s.key not in own and not s.effect.is_given)
        ordered = (*others, *(own.get(s.key, s) for s in effects if s not in others))
        still = len(others)
        return fit(self.columns, ordered, start, is_free=is_free, steps=_STEPS, still=still)

    def estimates(self, model: Model) -> Estimates:
        """Return the effects of a model of this recording with their deviations, by key."""
        std = reported_std(model, self.columns)
        return {s.key: (s, x) for s, x in zip(model.effects, std, strict=True)}


def common_models(real: Side, sim: Side, *, is_free: bool) -> tuple[Model, Model]:
    """Return the models of both in the structure that is worth most on the two together.

    What a law costs is paid once: one that is zero in the simulation is no law of it. Of a law of
    one side and a plain one of the other that it stands for, both have the same one. A law that
    cannot be on one side, such as friction that drives one way because bodies hold a load up,
    gives way to everyday laws.

    Args:
        real: the machine.
        sim: its simulation.
        is_free: whether bodies may differ from those of the robot file.
    """

    def fitted(effects: Collection[EffectAt]) -> tuple[float, tuple[Model, Model]]:
        ours, theirs = (side.fitted(tuple(effects), is_free=is_free) for side in (real, sim))
        worth = real.scale.worth(ours) + sim.scale.worth(theirs) + ours.law_price
        return worth, (ours, theirs)

    union = {s.key: s for s in (*sim.named, *real.named)}
    laws = tuple(union.values())
    plainer = tuple(s for s in laws if not any(s.stands_for(o) for o in laws))
    structures = {
        tuple(s.key for s in x): x for x in (real.named, sim.named, one_of_each(laws), plainer)
    }
    most = max(map(fitted, structures.values()), key=lambda x: x[0])
    both = {s.key for s in real.named} & {s.key for s in sim.named}
    while True:  # laws named on one side each may be one
        effects = most[1][0].effects
        fewer = [fitted([e for e in effects if e is not s]) for s in effects if s.key not in both]
        less = max(fewer, key=lambda x: x[0], default=most)
        if less[0] <= most[0]:
            break
        most = less
    best = most[1]
    wrong = _impossible(best)
    if wrong:
        everyday = [EffectAt(e, Place(s.place.joint)) for s in wrong for e in PLAIN]
        gone = {s.key for s in wrong}
        kept = [s for s in best[0].effects if s.key not in gone]
        plain = fitted({s.key: s for s in (*everyday, *kept)}.values())[1]
        if not _impossible(plain):
            return plain
    return best


def _impossible(models: Iterable[Model]) -> list[EffectAt]:
    """Return the effects that count in a model and have numbers that they cannot have."""
    return [
        s for m in models for s, share in zip(m.effects, m.shares, strict=True)
        if share > COUNTED_SHARE and _is_out_of_range(s, m.frame.equations.motion)
    ]  # fmt: skip


def _is_out_of_range(law: EffectAt, motion: ObservedMotion) -> bool:
    numbers = law.report(motion)
    known = [q for q in law.effect.stated_quantities(law.kind) if q.name in numbers]
    return any(float(numbers[q.name]) < q.low for q in known)
