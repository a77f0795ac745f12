"""The stages of a diagnosis one after the other: compare, explain, locate, decide, prove."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis.compare.equations import Equations, make_equations
from sgp_ros.diagnosis.compare.open_bodies import open_bodies, open_remark, with_open_bodies
from sgp_ros.diagnosis.compare.settled import collect_settled
from sgp_ros.diagnosis.compare.several import join
from sgp_ros.diagnosis.compare.sufficiency import (
    at_rest,
    require_motion,
    require_rows,
    require_signed,
)
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory, choose_bandwidth, collect
from sgp_ros.diagnosis.compare.velocity_sensor import sensor_lags
from sgp_ros.diagnosis.criteria import DOUBTED, REMAINDER_SHARE
from sgp_ros.diagnosis.decide.certainty import certainty_of, probabilities
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.differences import Several, decide_several
from sgp_ros.diagnosis.decide.equivalence import Contrasts, equivalents
from sgp_ros.diagnosis.decide.visibility import visibility
from sgp_ros.diagnosis.explain.comparison import Comparison
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.findings import (
    alternatives,
    asserted,
    bound_remarks,
    differences,
    parameter_errors,
)
from sgp_ros.diagnosis.locate.bands import bands
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.diagnosis.locate.remainder import Remainder, learn_remainder
from sgp_ros.diagnosis.prove.held_out import HELD_OUT, keep_back
from sgp_ros.diagnosis.prove.prediction import FinalModel, diagnosed_bodies
from sgp_ros.diagnosis.prove.processes import harm, kept_processes
from sgp_ros.diagnosis.prove.proof import prove, reasons_to_doubt
from sgp_ros.diagnosis.result import Diagnosis, Predictions, Proof, Traces
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.errors import NumericalError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.robot import Robot


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
    progress: Callable[[float], None] = lambda _share: None,
) -> Diagnosis:
    """Say what a recording has that the nominal robot lacks.

    Args:
        events: of the training recording; of several, by stem.
        robot: names, actuated joints and gains.
        tree: nominal robot.
        tests: events of held-out recordings, by stem.
        stated: effects that the nominal robot has, beside those of its tree.
        holds_out: whether blocks of the training recording are kept for the proof, as
            `held_out`; everything is then learned from the rest.
        is_static: whether the recordings hold settled points, one row a pose.
        config: settings of the intake.
        progress: called with the share that is done.

    Raises:
        ConfigError: a nominal robot that cannot move as its file states it.
        RecordingError: nothing can be used, nothing moves, or too little is left to decide.
        NumericalError: the motion leaves the equations without a solution.
    """
    unstated = open_bodies(robot.name, tree)
    several = dict(events) if isinstance(events, Mapping) else {'': events}
    raws, still = _collected(several, robot, tree, stated, config, is_static=is_static)
    read = collect_settled if is_static else collect
    held = {stem: read(test, robot, stated, config) for stem, test in tests.items()}
    learned, kept, remarks = _kept_back(raws) if holds_out else (join(raws), {}, ())
    if still:
        remarks += (f'Nothing can be said of joints that do not move: {", ".join(still)}.',)
    require_signed(learned, tree.moving_names)
    tree = with_open_bodies(learned, tree, unstated)
    remarks += open_remark(tree, unstated)
    recordings = _Recordings(tuple(several), learned, kept, held, still, remarks, unstated)
    bandwidth = choose_bandwidth(learned, tree)
    require_rows(learned, bandwidth)
    try:
        return _diagnosed(recordings, make_equations(learned, tree, bandwidth, unstated),
                          robot.name, progress)  # fmt: skip
    except np.linalg.LinAlgError as error:
        raise NumericalError(
            f'the equations of the recording have no solution ({error})',
            'motion of every joint',
            f'joints that do not move: {", ".join(still) or "none"}',
        ) from error


@dataclass(frozen=True, eq=False)
class _Recordings:
    """What is learned from, kept back and held out, with still joints, remarks, open bodies."""

    names: tuple[str, ...]
    learned: RawTrajectory
    kept: Mapping[str, RawTrajectory]
    held: Mapping[str, RawTrajectory]
    still: tuple[str, ...]
    remarks: tuple[str, ...]
    unstated: tuple[int, ...] = ()


def _collected(
    several: Mapping[str, Iterable[Event]],
    robot: Robot,
    tree: Tree,
    stated: tuple[EffectAt, ...],
    config: EngineConfig,
    *,
    is_static: bool,
) -> tuple[list[RawTrajectory], tuple[str, ...]]:
    """Return the recordings on grids of one step, and the joints that are still in all."""
    if is_static:
        return [collect_settled(x, robot, stated, config) for x in several.values()], ()
    known = [list(events) for events in several.values()]
    still = [require_motion(events, robot.name, tree.moving_names) for events in known]
    raws = [collect(events, robot, stated, config) for events in known]
    step = max(raw.step for raw in raws)
    raws = [
        raw if raw.step == step else collect(events, robot, stated, config, least_step=step)
        for raw, events in zip(raws, known, strict=True)
    ]
    raws = [
        at_rest(raw, np.isin(tree.moving_names, names))
        for raw, names in zip(raws, still, strict=True)
    ]
    return raws, tuple(name for name in still[0] if all(name in names for names in still))


def _kept_back(
    raws: Sequence[RawTrajectory],
) -> tuple[RawTrajectory, dict[str, RawTrajectory], tuple[str, ...]]:
    """Return what to learn from, what is held out of it by name, and what is to be said."""
    parts = [keep_back(raw) for raw in raws]
    kept = [held[HELD_OUT] for _, held, _ in parts if held]
    said = dict.fromkeys(remark for _, _, remarks in parts for remark in remarks)
    learned = join([part for part, _, _ in parts])
    return learned, {HELD_OUT: join(kept)} if kept else {}, tuple(said)


def _diagnosed(
    recordings: _Recordings,
    equations: Equations,
    robot: str,
    progress: Callable[[float], None],
) -> Diagnosis:
    raw, tree, names = recordings.learned, equations.motion.tree, recordings.names
    several = decide_several(equations, len(names), lambda x: progress(0.05 + 0.85 * x))
    whole, equations = equations, several.equations
    comparison, decision, model = several.comparison, several.decision, several.model
    depends = dependences(equations, comparison.base.residual)
    lags = [lag for lag in sensor_lags(raw, equations) if lag.is_physics]
    final, learned, on_z = _final(several, whole)
    contrasts = Contrasts(equations, decision.model)
    parts = {'train': raw, **recordings.kept, **recordings.held}
    proofs = {stem: prove(final, part, tree, stem) for stem, part in parts.items()}
    on_z += _harm(final, {k: x for k, x in parts.items() if k != 'train'}, proofs)
    doubts = reasons_to_doubt(proofs, recordings.still)
    chances = probabilities(equations, comparison, decision, contrasts)
    on_all = replace(decision, model=model)
    findings, forces = asserted(whole, on_all, lags, learned, chances, depends)
    differ = differences(several, names)
    certainty = certainty_of((*findings, *differ), equations, comparison)
    progress(1.0)
    if reasons_to_doubt({'train': proofs['train']}, recordings.still):
        findings = tuple(replace(f, probability=min(f.probability, DOUBTED)) for f in findings)
    return Diagnosis(
        robot=robot,
        joints=tree.moving_names,
        units=tuple('N' if p else 'N m' for p in tree.is_prismatic[: tree.size]),
        verdict=_verdict(decision, is_missing=bool(lags or differ)),
        certainty=min(certainty, DOUBTED) if doubts else certainty,
        findings=findings,
        alternatives=alternatives(decision, chances),
        parameter_errors=parameter_errors(whole, model, recordings.unstated),
        proofs=proofs,
        predictions=_predictions(final, recordings.held, tree),
        dependences=depends,
        bands=bands(equations, comparison.base.residual, depends),
        traces=_traces(whole, comparison, model, final.remainders, forces),
        cutoff_hz=equations.filter.cutoff,
        rate_hz=1.0 / (raw.step * equations.filter.decimation),
        rows=len(equations.d),
        refused={reason: count for reason, count in raw.refused.items() if count},
        remarks=(*raw.remarks, *recordings.remarks, *bound_remarks(decision), *on_z, *doubts),
        bodies=diagnosed_bodies(whole, model, recordings.unstated),
        equivalents=equivalents(equations, comparison, decision, contrasts),
        recordings=names if len(names) > 1 else (),
        differences=differ,
        visibility=visibility(equations, comparison, decision),
    )


def _verdict(decision: Decision, *, is_missing: bool) -> str:
    is_calm = decision.verdict in {'no_mismatch', 'parameters_only'}
    return 'missing_physics' if is_missing and is_calm else decision.verdict


def _final(
    several: Several, equations: Equations
) -> tuple[FinalModel, tuple[Remainder, ...], tuple[str, ...]]:
    """Return the final model, all processes that were learned, and what is to be said of them."""
    learned = _remainders(several.equations, several.decision)
    final = FinalModel(several.model, several.comparison.nominal, equations, learned)
    kept, remarks = kept_processes(final)
    return replace(final, remainders=kept), learned, remarks


def _remainders(equations: Equations, decision: Decision) -> tuple[Remainder, ...]:
    if decision.verdict != 'unexplained':
        return ()
    left = decision.model.mean_square / equations.power
    joints = [j for j in np.argsort(-left) if left[j] > REMAINDER_SHARE * left.max()]
    found = [learn_remainder(equations, decision.model.residual, int(j)) for j in joints[:2]]
    return tuple(r for r in found if r is not None)


def _predictions(
    final: FinalModel, held: Mapping[str, RawTrajectory], tree: Tree
) -> dict[str, Predictions]:
    """Return the accelerations of held-out recordings; settled points have none."""
    moved = {stem: part for stem, part in held.items() if part.approach is None}
    return {stem: final.predict(part, tree) for stem, part in moved.items()}


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
    )  # fmt: skip
