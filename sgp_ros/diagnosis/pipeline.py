"""The stages of a diagnosis one after the other: compare, explain, locate, decide, prove."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.compare.open_bodies import open_bodies
from sgp_ros.diagnosis.compare.sufficiency import require_signed
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.diagnosis.compare.velocity_sensor import sensor_lags
from sgp_ros.diagnosis.connected import Connected, compared
from sgp_ros.diagnosis.connecting import with_laws
from sgp_ros.diagnosis.decide.certainty import (
    Probabilities,
    certainty_of,
    doubted,
    rests_on,
    settled_of,
)
from sgp_ros.diagnosis.decide.differences import Several, without_laws_of
from sgp_ros.diagnosis.decide.equivalence import Contrasts, equivalents
from sgp_ros.diagnosis.decide.reasons import disagreement, left_remarks
from sgp_ros.diagnosis.decide.visibility import hides_friction, visibility
from sgp_ros.diagnosis.disturbed import undisturbed
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.findings import (
    alternatives,
    asserted,
    bound_remarks,
    differences,
    verdict_of,
)
from sgp_ros.diagnosis.gathered import Knowledge, Recordings, gather, prepared
from sgp_ros.diagnosis.locate.bands import bands
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.diagnosis.locate.remainder import Remainder
from sgp_ros.diagnosis.prove.held_out import HELD_OUT
from sgp_ros.diagnosis.prove.overlay import overlays
from sgp_ros.diagnosis.prove.prediction import FinalModel, diagnosed_bodies
from sgp_ros.diagnosis.prove.processes import final_model, harm
from sgp_ros.diagnosis.prove.proof import not_carried_over, prove, reasons_to_doubt
from sgp_ros.diagnosis.reference import (
    Reference,
    against_model,
    against_simulation,
    none_in_simulation,
)
from sgp_ros.diagnosis.result import Diagnosis, Proof
from sgp_ros.diagnosis.setup.said import doubted_scales
from sgp_ros.diagnosis.shown import Predictions, Traces
from sgp_ros.diagnosis.unlisted.at_tool import tool_remarks
from sgp_ros.diagnosis.wrong_bodies import parameter_errors, traded_remarks
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.errors import NumericalError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot

Progress = Callable[[float], None]
_MOVING = 0.9
"""Share of a filtered row in which no dry friction holds the joint, from which its laws show."""
_CALM = ('no_mismatch', 'parameters_only')
_UNCLEAR = 'It is unknown what machine and simulation have in common: one of them is unexplained.'


def diagnose(
    events: Iterable[Event] | Mapping[str, Iterable[Event]],
    robot: Robot,
    tree: Tree,
    tests: Mapping[str, Iterable[Event]],
    *,
    stated: tuple[EffectAt, ...] = (),
    holds_out: bool = False,
    is_static: bool = False,
    config: EngineConfig = USUAL,
    gains: Gains | None = None,
    simulation: Iterable[Event] | None = None,
    simulated: Sequence[EffectAt] | None = None,
    has_overlays: bool = False,
    progress: Progress = lambda _share: None,
) -> Diagnosis:
    """Say what a recording has that the nominal robot lacks.

    Args:
        events: of the training recording; of several, by stem.
        robot: names, actuated joints and gains.
        tree: nominal robot.
        tests: events of held-out recordings, by stem.
        stated: effects that the nominal robot has, beside those of its tree.
        holds_out: whether blocks are learned from no more, and kept for the proof as `held_out`.
        is_static: whether the recordings hold settled points, one row a pose.
        config: settings of the intake.
        gains: of drives that hold position targets; None where commands are efforts.
        simulation: events of the simulation to compare with; None for the robot alone.
        simulated: physics of a simulation that is known by its model, whose bodies `tree` has.
        has_overlays: whether motions of both models are replayed over the measured ones.
        progress: called with the share that is done.

    Raises:
        ConfigError: a nominal robot that cannot move as its file states it.
        RecordingError: nothing can be used, nothing moves, or too little is left to decide.
        NumericalError: the motion leaves the equations without a solution.
    """
    unstated = open_bodies(robot.name, tree)
    given = dict(events) if isinstance(events, Mapping) else {'': events}
    known = Knowledge(robot, stated, config, gains, is_static=is_static)
    recordings = gather(given, tests, tree, known, holds_out=holds_out)
    require_signed(recordings.learned, tree.moving_names)
    recordings, tree = prepared(recordings.thinned(), tree, unstated)
    try:
        connected = with_laws(undisturbed(recordings, tree, lambda x: progress(0.05 + 0.85 * x)))
        model, before = connected.several.decision.model, connected.uncorrected or connected
        shares = before.nominal, model.left
        said = doubted_scales(connected.findings, model.effects, shares, tree)
        connected = replace(connected, findings=said)
        found, asserts = _diagnosed(connected, robot.name, replays=has_overlays)
        connected = replace(connected, several=asserts)
        progress(1.0)
        if simulated is not None:
            reference = against_model(connected.equations, connected.several, simulated)
            return _compared(found, connected, reference, ())
        if simulation is None:
            return found
        recordings = gather({'': simulation}, {}, tree, known, holds_out=False)
        return _against(found, connected, replace(recordings, unstated=unstated), tree)
    except np.linalg.LinAlgError as error:
        raise NumericalError(
            f'the equations of the recording have no solution ({error})',
            'motion of every joint',
            f'record a motion of all joints (not moving: {", ".join(recordings.still) or "none"})',
        ) from error


def _diagnosed(connected: Connected, robot: str, *, replays: bool) -> tuple[Diagnosis, Several]:
    """Return the diagnosis of the recordings, and the models that it asserts."""
    recordings, whole = connected.recordings, connected.equations
    raw, tree, names = recordings.learned, whole.motion.tree, recordings.names
    parts = {'train': raw, **recordings.kept, **recordings.held}
    several, sides, chances, final, learned, left, proofs = _proven(connected, parts)
    equations, model, comparison = several.equations, several.model, several.comparison
    decision, depends = several.decision, dependences(equations, comparison.base.residual)
    lags = [lag for lag in sensor_lags(raw, equations) if lag.is_physics]
    doubts, on_all = reasons_to_doubt(proofs, recordings.still), replace(decision, model=model)
    wrong = parameter_errors(whole, model, recordings.unstated)
    findings, forces = asserted(whole, on_all, lags, learned, chances, depends)
    findings, differ = tuple(map(connected.against_rivals, findings)), differences(several, names)
    certainty = certainty_of((*findings, *differ), comparison, connected.trust, decision.verdict)
    vain = reasons_to_doubt({'train': proofs['train']}, recordings.still)
    findings = doubted(findings, vain, tree.moving_names)
    verdict = verdict_of(decision, wrong, connected.findings, *connected.left, lags or differ)
    hidden = hides_friction(equations, comparison, decision) if verdict in _CALM else ()
    traded = traded_remarks(whole, model, wrong, recordings.unstated)
    said_of = (*tool_remarks(decision), *bound_remarks(decision))
    remarks = (*said_of, *left, *chain(*doubts.values()), *hidden, *traded)
    is_doubted = bool(hidden) or rests_on(doubts, findings, tree.moving_names)
    said = Diagnosis(
        robot=robot,
        joints=tree.moving_names,
        units=tuple('N' if p else 'N m' for p in tree.is_prismatic[: tree.size]),
        verdict=verdict,
        certainty=None if is_doubted else _certainty(certainty, connected),
        findings=findings,
        alternatives=alternatives(decision, chances),
        parameter_errors=wrong,
        proofs=proofs,
        predictions=_predictions(final, connected, tree),
        dependences=depends,
        bands=bands(equations, comparison.base.residual, depends),
        traces=_traces(whole, comparison, model, final.remainders, forces),
        cutoff_hz=equations.filter.cutoff,
        rate_hz=1.0 / (raw.step * equations.filter.decimation),
        rows=len(equations.d),
        refused={reason: count for reason, count in raw.refused.items() if count},
        remarks=(*connected.remarks, *raw.remarks, *remarks),
        bodies=diagnosed_bodies(whole, model, recordings.unstated),
        equivalents=(*equivalents(equations, comparison, decision, sides), *connected.equivalents),
        recordings=names if len(names) > 1 else (),
        differences=differ,
        setup=connected.findings,
        visibility=visibility(equations, comparison, decision),
        overlays=overlays(final, parts if replays else {}, tree),
        law_searches=connected.laws,
    )
    return said, several


_Proven = tuple[Several, Contrasts, Probabilities, FinalModel, tuple[Remainder, ...],
                tuple[str, ...], dict[str, Proof]]  # fmt: skip


def _proven(connected: Connected, parts: Mapping[str, RawTrajectory]) -> _Proven:
    """Return what is asserted with its proofs; laws that fail on another recording are dropped."""
    several = connected.several
    while True:
        several, sides, chances = settled_of(several)
        final, learned, on_z = final_model(several, connected.equations)
        tree = connected.equations.motion.tree
        proofs = {stem: prove(final, part, tree, stem) for stem, part in parts.items()}
        others = {stem: proof for stem, proof in proofs.items() if stem != HELD_OUT}
        fewer = without_laws_of(several, not_carried_over(others, connected.recordings.still))
        if fewer is several:
            on_z += _harm(final, {k: x for k, x in parts.items() if k != 'train'}, proofs)
            left = left_remarks(several.equations, several.model, several.decision.unknown)
            return several, sides, chances, final, learned, (*on_z, *left), proofs
        several = fewer


def _against(
    found: Diagnosis, connected: Connected, simulation: Recordings, tree: Tree
) -> Diagnosis:
    """Return the diagnosis against a simulation instead of the robot."""
    sim = compared(simulation, tree, lambda _share: None)
    left = sim.several.comparison.nominal.mean_square / sim.equations.power
    shares = dict(zip(found.joints, map(float, left), strict=True))
    said = disagreement(shares)
    found = replace(found, simulation=shares)
    if not said:  # it simulates the nominal robot
        findings = tuple(none_in_simulation(f) for f in found.findings)
        return replace(found, reference='simulation', findings=findings)
    reference = against_simulation(
        connected.equations, connected.several, sim.equations, settled_of(sim.several)[0],
        connected.recordings.unstated,
    )  # fmt: skip
    return _compared(found, connected, reference, (said,))


def _compared(
    found: Diagnosis, connected: Connected, reference: Reference | None, said: tuple[str, ...]
) -> Diagnosis:
    """Return the diagnosis with what differs from the simulation in the place of its findings."""
    if reference is None:
        return replace(found, remarks=(*said, _UNCLEAR, *found.remarks))
    is_calm, bodies = reference.verdict in _CALM, reference.bodies
    return replace(
        found, reference='simulation', findings=reference.findings, shared=reference.shared,
        verdict='setup_error' if is_calm and connected.findings else reference.verdict,
        certainty=_certainty(reference.certainty, connected),
        traces=replace(found.traces, forces=()),
        remarks=(*said, *reference.remarks, *found.remarks),
        parameter_errors=found.parameter_errors if bodies is None else bodies,
    )  # fmt: skip


def _certainty(certainty: float, connected: Connected) -> float:
    """Return the least of what the verdict rests on."""
    return min([certainty, *(f.probability for f in connected.findings)])


def _predictions(final: FinalModel, connected: Connected, tree: Tree) -> dict[str, Predictions]:
    """Return the accelerations of held-out recordings; settled points have no acceleration."""
    held = connected.recordings.held
    moved = {stem: part for stem, part in held.items() if part.approach is None}
    return {stem: connected.recorded(final.predict(part, tree)) for stem, part in moved.items()}


def _harm(
    final: FinalModel, held: Mapping[str, RawTrajectory], proofs: Mapping[str, Proof]
) -> tuple[str, ...]:
    """Say where Z does harm on what was held out."""
    if not final.remainders:
        return ()
    tree, physics = final.equations.motion.tree, replace(final, remainders=())
    plain = {stem: prove(physics, part, tree, stem) for stem, part in held.items()}
    return harm(final.remainders, tree.joint_names, plain, proofs)


def _traces(
    equations: Equations,
    comparison: Comparison,
    model: Model,
    remainders: tuple[Remainder, ...],
    forces: tuple[np.ndarray, ...],
) -> Traces:
    motion, low = equations.motion, equations.filter
    after = model.residual.copy()
    for r in remainders:
        after[:, r.joint] -= low(r.force(motion))
    time = equations.time
    if motion.recording is not None:  # one after the other, each on its own clock
        at = motion.recording[low.rows]
        lengths = [motion.time[motion.recording == r].max() for r in range(at.max() + 1)]
        time = time + np.cumsum([0.0, *lengths])[at]
    return Traces(
        time, low(motion.position), low(motion.velocity), low(motion.effort),
        equations.d, comparison.parameters.residual, after, equations.noise, forces,
        low(model.frame.equations.moving) > _MOVING,
    )  # fmt: skip
