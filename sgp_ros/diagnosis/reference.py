"""Differences between a machine and its simulation, in both directions.

Both recordings are explained by one structure: the effects named on the machine, those named on
the simulation, or all of them, whichever is worth most on the two together. Each recording then
gives the numbers of that structure with their errors. An effect differs where the difference is
beyond its error and its force counts as physics, against the effort that moves: gravity, which
both carry, would hide it. Bodies are compared by their force in the same way.

A simulation may also be known by its model file. Its bodies are then the nominal ones, and what
it states needs no fit.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sgp_ros.diagnosis.common_structure import Side, common_models
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.power import moving_power
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    INTERVAL,
    MOST_CERTAIN,
    PER_EFFECT,
    SAME_LEVEL,
    TEMPER,
)
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.findings import stated_parameters
from sgp_ros.diagnosis.result import Finding, Location, Parameter, ParameterError
from sgp_ros.diagnosis.wrong_bodies import parameter_errors, traded_remarks
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place, joint_name


@dataclass(frozen=True, eq=False)
class Reference:
    """The machine against its simulation.

    Attributes:
        verdict: one of `VERDICTS`.
        findings: effects that differ, with their numbers on both.
        shared: effects that both have alike.
        certainty: probability that the verdict is right.
        has_other_bodies: whether what bodies differ in counts as physics.
        bodies: of the machine that differ from those of the simulation; None where these are
            the nominal ones.
        remarks: on numbers of bodies that differ and cannot be placed.
    """

    verdict: str
    findings: tuple[Finding, ...]
    shared: tuple[Finding, ...]
    certainty: float
    has_other_bodies: bool
    bodies: tuple[ParameterError, ...] | None = None
    remarks: tuple[str, ...] = ()


def against_simulation(
    equations: Equations, several: Several, simulated: Equations, simulation: Several,
    unstated: Collection[int] = (),
) -> Reference | None:  # fmt: skip
    """Return what differs; None where either recording is unexplained.

    Args:
        equations: of the machine.
        several: its models.
        simulated: equations of the simulation, for the same nominal robot.
        simulation: its models.
        unstated: bodies that the robot's file leaves open.
    """
    decisions = several.decision, simulation.decision
    if any(d.verdict == 'unexplained' for d in decisions):
        return None
    real, sim = Side.of(equations, several), Side.of(simulated, simulation)
    is_free = any(d.model.is_free for d in decisions)
    ours, theirs = common_models(real, sim, is_free=is_free)
    known, named = sim.estimates(theirs), {s.key for s in sim.named}
    power = moving_power(equations.motion, equations.power)
    findings: list[Finding] = []
    shared: list[Finding] = []
    for here, of_here in real.estimates(ours).values():
        there, of_there = known[here.key]
        is_known = here.key in named
        finding = _compared(here, there, (of_here, of_there), equations, is_in_simulation=is_known)
        finding = _sized(finding, here, is_in_simulation=is_known)
        force = (
            here.columns(equations.motion) @ here.coefficients
            - there.columns(equations.motion) @ there.coefficients
        )
        finding = replace(finding, share=_share(force, equations, power, here.place.joint))
        (findings if _counts(finding, here) else shared).append(_judged(finding, here))
    found = _reference(equations, findings, shared, ours.w - theirs.w)
    if not found.has_other_bodies:
        return replace(found, bodies=())
    bodies = parameter_errors(equations, ours, unstated, theirs)
    return replace(
        found, bodies=bodies,
        remarks=tuple(traded_remarks(equations, ours, bodies, unstated, theirs)),
    )  # fmt: skip


def against_model(
    equations: Equations, several: Several, stated: Sequence[EffectAt]
) -> Reference | None:
    """Return what differs from a model; None where the recording is unexplained.

    Args:
        equations: of the machine, for the bodies of the model alone.
        several: its models.
        stated: all physics of the model beside its bodies.
    """
    if several.decision.verdict == 'unexplained':
        return None
    real = Side.of(equations, several)
    is_free = several.decision.model.is_free
    theirs = {s.key: s for s in stated}
    union = theirs | {s.key: s for s in real.named}
    models = [real.fitted(x, is_free=is_free) for x in (real.named, tuple(union.values()))]
    ours = max(models, key=real.scale.worth)
    motion = equations.motion
    power = moving_power(motion, equations.power)
    findings: list[Finding] = []
    shared: list[Finding] = []
    for here, std in real.estimates(ours).values():
        there = theirs.pop(here.key, None)
        if there is None:
            said = stated_parameters(here, motion, dict(std))
            finding = none_in_simulation(_plain(here, said, equations, MOST_CERTAIN))
            force = here.force(motion)
        else:
            finding = _compared(here, there, (std, {}), equations)
            force = here.force(motion) - there.force(motion)
        finding = replace(finding, share=_share(force, equations, power))
        (findings if _counts(finding, here) else shared).append(_judged(finding, here))
    with_all = real.estimates(models[1]) if theirs else {}
    for there in theirs.values():
        share = _share(there.force(motion), equations, power)
        here, std = with_all[there.key]
        apart = _compared(here, there, (std, {}), equations).probability
        if share > COUNTED_SHARE and apart > 0.5:
            findings.append(_absent(there, equations, apart, share))
        else:  # too little to be seen, or bodies say the same: the simulation may be right
            said = stated_parameters(there, motion, {})
            found = _plain(there, said, equations, 1.0 if share <= COUNTED_SHARE else 1.0 - apart)
            shared.append(replace(found, share=share, in_simulation=said))
    return _reference(equations, findings, shared, ours.w)


def _reference(
    equations: Equations, findings: list[Finding], shared: list[Finding], shift: np.ndarray
) -> Reference:
    """Return the comparison; `shift` (p,) is by how much the bodies differ."""
    moved = (equations.force_of_bodies(shift) ** 2).mean(axis=0)
    power = moving_power(equations.motion, equations.power)
    is_other = bool((moved > COUNTED_SHARE * power).any())
    calm = 'parameters_only' if is_other else 'no_mismatch'
    findings.sort(key=lambda f: -f.probability)
    verdict = 'missing_physics' if findings else calm
    stated = [f.probability for f in findings]
    stated = stated or [f.probability for f in shared if f.share > COUNTED_SHARE]
    certainty = min([*stated, MOST_CERTAIN])
    return Reference(verdict, tuple(findings), tuple(shared), certainty, is_other)


def _sized(found: Finding, law: EffectAt, *, is_in_simulation: bool) -> Finding:
    """Return a finding with the sizes alone of a law on a side that may have none of it.

    A spring without stiffness has no rest position.
    """
    sizes, sides = {q.name for q in law.sizes}, ['difference']
    sides += [] if is_in_simulation else ['in_simulation']
    sides += ['parameters'] * (_evidence_of_any(law, found.parameters) < 0.5 * INTERVAL**2)
    if len(sides) == 1:
        return found
    only: dict[str, Any] = {
        x: {n: p for n, p in getattr(found, x).items() if n in sizes} for x in sides
    }
    return replace(found, **only)


def _counts(found: Finding, law: EffectAt) -> bool:
    """Return whether the numbers of a law on both sides differ by what counts as physics."""
    is_known = found.share > COUNTED_SHARE and found.probability > 0.5
    return is_known and not _is_alike(found, law)


def _is_alike(found: Finding, law: EffectAt) -> bool:
    """Return whether the sizes of a law that nearly every joint has are the same."""
    numbers = [(float(found.parameters[n].value), float(x.value))
               for n, x in found.difference.items()]  # fmt: skip
    return bool(law.effect.is_usual and numbers) and all(
        abs(apart) < SAME_LEVEL * max(abs(ours), abs(ours - apart)) for ours, apart in numbers
    )


def _judged(found: Finding, law: EffectAt) -> Finding:
    """Return a finding; if shared, as probable as it is alike, or why its numbers may differ."""
    if _counts(found, law):
        return found
    if found.probability > 0.5:
        is_small = found.share <= COUNTED_SHARE
        return replace(found, why='they differ by too little to count' if is_small else (
            'they differ by no more than friction does with load, speed and warmth'))  # fmt: skip
    return replace(found, probability=min(1.0 - found.probability, MOST_CERTAIN))


def _plain(
    effect: EffectAt, parameters: Mapping[str, Parameter], equations: Equations, p: float
) -> Finding:
    return Finding(
        joint_name(equations.motion, effect.place.joint), effect.name, dict(parameters),
        Location(), 0.0, min(p, MOST_CERTAIN), 0.0, effect.effect.formula,
    )  # fmt: skip


def _absent(effect: EffectAt, equations: Equations, p: float, share: float) -> Finding:
    """Return a finding of what the simulation has and the machine has not."""
    theirs = stated_parameters(effect, equations.motion, {})
    neutral = {q.name: q.neutral for q in effect.sizes}
    none = {n: replace(x, value=neutral[n]) for n, x in theirs.items() if n in neutral}
    apart = {n: replace(x, value=x.value - float(theirs[n].value)) for n, x in none.items()}  # type: ignore[operator]  # sizes are numbers
    found = _plain(effect, {**theirs, **none}, equations, p)
    return replace(found, share=share, in_simulation=theirs, difference=apart)


def none_in_simulation(found: Finding) -> Finding:
    """Return a finding against a simulation of the nominal robot, which has none of it."""
    if found.effect not in EFFECTS:
        return found
    sizes = EffectAt(EFFECTS[found.effect], Place(0)).sizes
    ours = {q: found.parameters[q.name] for q in sizes if q.name in found.parameters}
    none = {q.name: Parameter(q.neutral, None, p.unit) for q, p in ours.items()}
    apart = {q.name: replace(p, value=float(p.value) - q.neutral) for q, p in ours.items()}
    return replace(found, in_simulation=none, difference=apart)


def _share(force: np.ndarray, equations: Equations, power: np.ndarray, joint: int = 0) -> float:
    """Return the largest share of a force while its joint moves; (n, k), or (n,) on one joint.

    At rest friction takes what drives the joint, whatever its law says of no speed.
    """
    moving = ~equations.rests
    if force.ndim == 1:
        moving, power = moving[:, joint], power[joint]
    return float(np.max(((force * moving) ** 2).mean(axis=0) / power))


def _evidence_of_any(law: EffectAt, numbers: Mapping[str, Parameter]) -> float:
    """Return by how much the sizes of a law speak against its absence [nats]."""
    known = [(q.neutral, numbers[q.name]) for q in law.sizes if q.name in numbers]
    away = [abs(float(p.value) - none) / p.std for none, p in known if p.std]
    return 0.5 * max(away, default=math.inf) ** 2


def _compared(
    here: EffectAt, there: EffectAt, std: tuple[Mapping[str, float], ...], equations: Equations,
    *, is_in_simulation: bool = True,
) -> Finding:  # fmt: skip
    """Return an effect with its numbers on both sides, and the probability that they differ.

    Where a simulation is explained without it, none there is as likely as the same is.
    """
    motion = equations.motion
    ours, theirs = (
        stated_parameters(s, motion, dict(x)) for s, x in zip((here, there), std, strict=True)
    )
    difference: dict[str, Parameter] = {}
    furthest = 0.0
    for name, p in ours.items():
        other = theirs.get(name)
        if isinstance(p.value, str) or other is None or isinstance(other.value, str):
            continue
        error = math.hypot(p.std or 0.0, other.std or 0.0)
        apart = p.value - other.value
        difference[name] = Parameter(apart, error or None, p.unit)
        if error > 0.0:
            furthest = max(furthest, abs(apart) / error)
    price = PER_EFFECT if is_in_simulation else min(PER_EFFECT, _evidence_of_any(there, theirs))
    odds = math.exp(min(TEMPER * (price - 0.5 * furthest**2), 50.0))
    return Finding(
        joint_name(motion, here.place.joint), here.name, ours, Location(), 0.5 * furthest**2,
        min(1.0 / (1.0 + odds), MOST_CERTAIN), 0.0, here.effect.formula,
        in_simulation=theirs, difference=difference,
    )  # fmt: skip
