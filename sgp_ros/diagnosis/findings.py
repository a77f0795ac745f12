"""Fitted models in the words of the schema."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.velocity_sensor import SensorLag
from sgp_ros.diagnosis.criteria import (
    COUNTED_SHARE,
    DOUBTED,
    INTERVAL,
    NUMBER_ERROR,
    REGION_ENERGY,
    SLIGHT_REST,
)
from sgp_ros.diagnosis.decide.certainty import Probabilities
from sgp_ros.diagnosis.decide.cross_validation import physics_left
from sgp_ros.diagnosis.decide.decision import UNKNOWN, Decision
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.everyday import widened
from sgp_ros.diagnosis.decide.reasons import held_remarks, why_not
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.in_recording import InRecording
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.explain.uncertainty import reported_std
from sgp_ros.diagnosis.locate.remainder import Remainder, region
from sgp_ros.diagnosis.result import Difference, Finding, Location, Parameter, ParameterError
from sgp_ros.diagnosis.shown import Dependence
from sgp_ros.physics.catalogue import VELOCITY_FILTER_LAG, VISCOUS_FRICTION
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import joint_name
from sgp_ros.physics.servo import Servo
from sgp_ros.robots.observed_motion import ObservedMotion

MOST_ALTERNATIVES = 8


def asserted(
    equations: Equations,
    decision: Decision,
    lags: Sequence[SensorLag],
    remainders: Sequence[Remainder],
    chances: Probabilities,
    depends: Sequence[Dependence],
) -> tuple[tuple[Finding, ...], tuple[np.ndarray, ...]]:
    """Return the findings of a verdict, most probable first, and the force of each (N, k)."""
    model = decision.model
    common = [i for i, s in enumerate(model.effects) if not isinstance(s.effect, InRecording)]
    forces = [model.forces[i] for i in common]
    std = widened(equations, model, decision.unknown) if common else ()
    for i in common:  # of everyday laws beside something unknown, whose only number is their size
        own = decision.standing.get(model.effects[i].key, 0.0)
        std[i].update(dict.fromkeys(std[i], own) if own else {})
    left, findings = physics_left(equations, model, decision.unknown), []
    for i, force in zip(common, forces, strict=True):
        s, moved = model.effects[i], (force**2).mean(axis=0) > COUNTED_SHARE * equations.power
        found = doubted_if_none(_finding(decision, model, i, std[i], chances), s)
        found = doubted_if_late(found, s, equations.motion)
        findings.append(doubted_beside(found, s, left[moved]))
    findings += [
        _unknown(equations, decision, j, remainders, chances, depends) for j in decision.unknown
    ]
    names = equations.motion.tree.joint_names
    for lag in lags:
        unit = Parameter(lag.time_constant, max(lag.std, NUMBER_ERROR * lag.time_constant), 's')
        findings.append(
            Finding(
                names[lag.joint], VELOCITY_FILTER_LAG.name, {'time_constant': unit}, Location(),
                lag.nats, 0.9 * (1.0 - min(lag.rest, 1.0)), lag.share, VELOCITY_FILTER_LAG.formula,
            )
        )  # fmt: skip
    forces += [np.zeros_like(equations.d)] * (len(findings) - len(forces))
    order = sorted(range(len(findings)), key=lambda i: -findings[i].probability)
    return tuple(findings[i] for i in order), tuple(forces[i] for i in order)


def differences(several: Several, names: Sequence[str]) -> tuple[Difference, ...]:
    """Return what differs between recordings of these names, most probable first.

    The standard deviation of a number in its recording is that of the difference, which is wider.
    """
    model = several.model
    equations = model.frame.equations
    motion = equations.motion
    if not several.chances or motion.recording is None:
        return ()
    std = reported_std(model, Columns(equations))
    common = {s.key: s for s in model.effects}
    at = motion.recording[equations.filter.rows]
    found = []
    for i, s in enumerate(model.effects):
        if not isinstance(s.effect, InRecording):
            continue
        law, force = s.effect.law, model.forces[i][at == s.effect.recording]
        own = stated_parameters(s, motion, std[i])
        whole, shared = own, common.get((law.name, s.place))
        if shared is not None and law.linear:
            c = s.coefficients + shared.coefficients
            whole = stated_parameters(replace(s, coefficients=c), motion, std[i])
        found.append(
            Difference(
                names[s.effect.recording], joint_name(motion, s.place.joint), law.name,
                whole, own, several.chances[s.key],
                float(((force**2).mean(axis=0) / equations.power).max()),
            )
        )  # fmt: skip
    return tuple(sorted(found, key=lambda d: -d.probability))


def doubted_if_none(finding: Finding, effect: EffectAt) -> Finding:
    """Return a finding, doubted if its size may be zero, or is too small to count as physics.

    One 95 % interval of its sizes must exclude zero; in a form that the data chose, each must. A
    finding with all sizes at bounds, which have no interval, is kept. Where a plain law is the
    same with sizes that are equal, these must differ, or all exclude zero.
    """
    chance = min(finding.probability, DOUBTED)
    if finding.share <= COUNTED_SHARE:
        return replace(finding, probability=chance, why='its share is too small to count')
    known = [(finding.parameters[q.name], q.neutral) for q in effect.sizes]
    away = [abs(float(p.value) - neutral) > INTERVAL * p.std
            for p, neutral in known if p.std is not None]  # fmt: skip
    why = ''
    if effect.effect.plain and not all(away) and not _differ([p for p, _ in known]):
        why = 'the 95 % interval of what sets it apart from a plainer law includes zero'
    if not (all(away) if effect.effect.has_chosen_form else any(away) or not away):
        why = 'the 95 % interval of its size includes zero'
    return replace(finding, probability=chance, why=why) if why else finding


def doubted_if_late(finding: Finding, effect: EffectAt, motion: ObservedMotion) -> Finding:
    """Return a finding, doubted if it is friction that a drive takes off by acting late.

    A drive computes its effort from states up to one sample old, and holds it: it drives on with
    `kp T v` of a lag T.
    """
    drive = motion.drive
    if effect.effect is not VISCOUS_FRICTION or not isinstance(drive, Servo) or drive.is_recorded:
        return finding
    lag = -float(effect.coefficients[0]) / float(drive.kp[effect.place.joint])
    if not 0.0 < lag < motion.step:
        return finding
    why = f'a drive that acts on states {1e3 * lag:.2g} ms old would do the same'
    return replace(finding, probability=min(finding.probability, DOUBTED), why=why)


def doubted_beside(finding: Finding, effect: EffectAt, left: np.ndarray) -> Finding:
    """Return a finding, doubted if physics is `left` at each joint where a rare law counts.

    Another law would explain that, and may hide in this one, whose form was not chosen. What says
    the same at a joint where nothing is left is no disguise.
    """
    law, at_joint = effect.effect, effect.place.joint >= 0
    if law.is_usual or law.has_chosen_form or not (at_joint and left.size and left.all()):
        return finding
    why = 'what is left at its joint comes back with the motion, and counts as physics'
    return replace(finding, probability=min(finding.probability, DOUBTED), why=why)


def _differ(sizes: Sequence[Parameter]) -> bool:
    """Return whether sizes of one unit differ by more than their 95 % interval; True of others."""
    known = [(float(p.value), p.std) for p in sizes if p.std is not None]
    if len(known) < 2 or len({p.unit for p in sizes}) > 1:
        return True
    return bool(np.ptp([x for x, _ in known]) > INTERVAL * np.linalg.norm([s for _, s in known]))


def alternatives(decision: Decision, chances: Probabilities) -> tuple[Finding, ...]:
    """Return the rivals of the asserted findings, best first; what was refused is doubted."""
    taken = {s.key for s in decision.model.effects}
    found: list[Finding] = []
    for model in decision.rivals:
        for i, candidate in enumerate(model.effects):
            if candidate.key in taken or len(found) >= MOST_ALTERNATIVES:
                continue
            taken.add(candidate.key)
            why = why_not(model, decision, chances.scale)
            rival = _finding(decision, model, i, {}, chances, why)
            found.append(replace(rival, probability=min(rival.probability, DOUBTED)))
    return tuple(found)


def _finding(
    decision: Decision,
    model: Model,
    index: int,
    std: dict[str, float],
    chances: Probabilities,
    why: str = '',
) -> Finding:
    candidate = model.effects[index]
    motion = model.frame.equations.motion
    inside = candidate.effect.interval(candidate, motion)
    location = Location((inside[0],), {inside[0]: inside[1]}) if inside else Location()
    return Finding(
        joint_name(motion, candidate.place.joint), candidate.name,
        stated_parameters(candidate, motion, std), location, float(model.score - decision.against),
        chances.of(model, index), model.shares[index], candidate.effect.formula, why,
    )  # fmt: skip


def stated_parameters(
    effect: EffectAt, motion: ObservedMotion, std: dict[str, float]
) -> dict[str, Parameter]:
    """Return the reported numbers with units and standard deviations, and the words."""
    joint = effect.place.joint
    prismatic = joint >= 0 and bool(motion.tree.is_prismatic[joint])
    known = effect.effect.stated_quantities(effect.kind)
    units = {q.name: q.unit_on(is_prismatic=prismatic) for q in known}
    at_bounds = effect.at_bounds(motion)
    found = {}
    for name, value in effect.report(motion).items():
        spread = std.get(name)
        if isinstance(value, str):
            found[name] = Parameter(value)
            continue
        if name in at_bounds:
            spread = None
        if spread is not None:
            spread = float(np.hypot(spread, NUMBER_ERROR * abs(value)))
        found[name] = Parameter(value, spread, units[name])
    return found


def bound_remarks(decision: Decision) -> tuple[str, ...]:
    """Say which numbers of asserted effects are where their search ends, or what they rest on."""
    motion = decision.model.frame.equations.motion
    remarks = []
    for s in decision.model.effects:
        ends = s.at_bounds(motion)
        names = [name.replace('_', ' ') for name in s.report(motion) if name in ends]
        if names:
            where = f'{s.effect.words} ({joint_name(motion, s.place.joint)})'
            remarks.append(
                f'{", ".join(names)} of {where}: at the limit of what this recording can '
                'determine, so no interval is given; the true value may lie beyond.'
            )
    return (*remarks, *held_remarks(decision.model))


def _unknown(
    equations: Equations,
    decision: Decision,
    joint: int,
    remainders: Sequence[Remainder],
    chances: Probabilities,
    depends: Sequence[Dependence],
) -> Finding:
    names = equations.motion.tree.joint_names
    seen = [r for r in remainders if r.joint == joint]
    own = depends[joint]
    on = 'it is not a function of the motion'
    if seen:
        on = f'it depends on {", ".join(seen[0].inputs)}'
    if seen and not any(own.is_significant(name) for name in own.scores):
        on = f'Z depends on {", ".join(seen[0].inputs)}, but on no single one significantly'
    share = float(decision.model.mean_square[joint] / equations.power[joint])
    where = region(equations, decision.model.residual[:, joint], joint)
    if where.variables:
        (name,) = where.variables
        ((lo, hi),) = where.intervals.get(name, where.time)
        on += f'; {100 * REGION_ENERGY:.0f} % of it lies where {name} is '
        on += f'between {lo:.3g} and {hi:.3g}'
    # the joint that comes first is the answer
    chance = float(min(chances.unknown[joint], chances.unknown[decision.unknown[0]]))
    return Finding(names[joint], UNKNOWN, {}, where, 0.0, chance, share, '', on)


def verdict_of(
    decision: Decision,
    wrong: Sequence[ParameterError],
    setup: Sequence[Finding],
    nominal: np.ndarray,
    gained: np.ndarray,
    beside: Sequence[object],
) -> str:
    """Return the verdict of a diagnosis.

    Bodies are wrong where it helps to correct one of them, or what they leave counts as physics.

    Args:
        decision: on the models.
        wrong: bodies that differ.
        setup: errors of the connection.
        nominal: (k,) shares of the discrepancy from the nominal robot.
        gained: (k,) how much less of it corrected bodies leave.
        beside: missing physics beside the models.
    """
    if decision.verdict not in {'no_mismatch', 'parameters_only'}:
        return decision.verdict
    if beside:
        return 'missing_physics'
    if setup:
        return 'setup_error'
    is_slight = nominal.max() < COUNTED_SHARE and (not wrong or gained.max() < SLIGHT_REST)
    return 'no_mismatch' if is_slight else decision.verdict
