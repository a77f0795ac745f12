"""The stages of a diagnosis one after the other: compare, explain, locate, decide, prove."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis.compare.equations import Equations, make_equations
from sgp_ros.diagnosis.compare.open_bodies import open_bodies, open_remark, with_open_bodies
from sgp_ros.diagnosis.compare.sufficiency import at_rest, require_motion, require_rows
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory, choose_bandwidth, collect
from sgp_ros.diagnosis.compare.velocity_sensor import sensor_lags
from sgp_ros.diagnosis.criteria import DOUBTED, REMAINDER_SHARE
from sgp_ros.diagnosis.decide.certainty import certainty_of, probabilities
from sgp_ros.diagnosis.decide.decision import Decision, decide
from sgp_ros.diagnosis.decide.equivalence import Contrasts, equivalents
from sgp_ros.diagnosis.explain.comparison import Comparison, compare_models
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.findings import alternatives, asserted, parameter_errors
from sgp_ros.diagnosis.locate.bands import bands
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.diagnosis.locate.remainder import Remainder, learn_remainder
from sgp_ros.diagnosis.prove.held_out import keep_back
from sgp_ros.diagnosis.prove.prediction import FinalModel, diagnosed_bodies
from sgp_ros.diagnosis.prove.processes import harm, kept_processes
from sgp_ros.diagnosis.prove.proof import prove, reasons_to_doubt
from sgp_ros.diagnosis.result import Diagnosis, Proof, Traces
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
from sgp_ros.errors import NumericalError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.robot import Robot


def diagnose(
    events: Iterable[Event],
    robot: Robot,
    tree: Tree,
    tests: Mapping[str, Iterable[Event]],
    *,
    stated: tuple[EffectAt, ...] = (),
    holds_out: bool = False,
    config: EngineConfig = USUAL,
    progress: Callable[[float], None] = lambda _share: None,
) -> Diagnosis:
    """Say what a recording has that the nominal robot lacks.

    Args:
        events: of the training recording.
        robot: names, actuated joints and gains.
        tree: nominal robot.
        tests: events of held-out recordings, by stem.
        stated: effects that the nominal robot has, beside those of its tree.
        holds_out: whether blocks of the training recording are kept for the proof, as
            `held_out`; everything is then learned from the rest.
        config: settings of the intake.
        progress: called with the share that is done.

    Raises:
        ConfigError: a nominal robot that cannot move as its file states it.
        RecordingError: nothing can be used, nothing moves, or too little is left to decide.
        NumericalError: the motion leaves the equations without a solution.
    """
    unstated = open_bodies(robot.name, tree)
    known = list(events)
    still = require_motion(known, robot.name, tree.moving_names)
    raw = at_rest(collect(known, robot, stated, config), np.isin(tree.moving_names, still))
    held = {stem: collect(test, robot, stated, config) for stem, test in tests.items()}
    learned, kept, remarks = keep_back(raw) if holds_out else (raw, {}, ())
    if still:
        remarks += (f'Nothing can be said of joints that do not move: {", ".join(still)}.',)
    tree = with_open_bodies(learned, tree, unstated)
    remarks += open_remark(tree, unstated)
    recordings = _Recordings(learned, kept, held, still, remarks, unstated)
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

    learned: RawTrajectory
    kept: Mapping[str, RawTrajectory]
    held: Mapping[str, RawTrajectory]
    still: tuple[str, ...]
    remarks: tuple[str, ...]
    unstated: tuple[int, ...] = ()


def _diagnosed(
    recordings: _Recordings,
    equations: Equations,
    robot: str,
    progress: Callable[[float], None],
) -> Diagnosis:
    raw, tree = recordings.learned, equations.motion.tree
    comparison = compare_models(equations, lambda share: progress(0.05 + 0.85 * share))
    decision = decide(equations, comparison)
    lags = [lag for lag in sensor_lags(raw, equations) if lag.is_physics]
    learned = _remainders(equations, decision)
    final = FinalModel(decision.model, comparison.nominal, equations, learned)
    remainders, on_z = kept_processes(final)
    final = replace(final, remainders=remainders)
    contrasts = Contrasts(equations, decision.model)
    parts = {'train': raw, **recordings.kept, **recordings.held}
    proofs = {stem: prove(final, part, tree, stem) for stem, part in parts.items()}
    on_z += _harm(final, {k: x for k, x in parts.items() if k != 'train'}, proofs)
    doubts = reasons_to_doubt(proofs, recordings.still)
    chances = probabilities(equations, comparison, decision, contrasts)
    depends = dependences(equations, comparison.base.residual)
    findings, forces = asserted(equations, decision, lags, learned, chances, depends)
    certainty = certainty_of(findings, equations, comparison)
    if doubts:
        certainty = min(certainty, DOUBTED)
    if reasons_to_doubt({'train': proofs['train']}, recordings.still):
        findings = tuple(replace(f, probability=min(f.probability, DOUBTED)) for f in findings)
    progress(1.0)
    return Diagnosis(
        robot=robot,
        joints=tree.moving_names,
        units=tuple('N' if p else 'N m' for p in tree.is_prismatic[: tree.size]),
        verdict='missing_physics' if lags and decision.verdict in _CALM else decision.verdict,
        certainty=certainty,
        findings=findings,
        alternatives=alternatives(decision, chances),
        parameter_errors=parameter_errors(equations, decision.model, recordings.unstated),
        proofs=proofs,
        predictions={stem: final.predict(part, tree) for stem, part in recordings.held.items()},
        dependences=depends,
        bands=bands(equations, comparison.base.residual, depends),
        traces=_traces(equations, comparison, decision.model, remainders, forces),
        cutoff_hz=equations.filter.cutoff,
        rate_hz=1.0 / (raw.step * equations.filter.decimation),
        rows=len(equations.d),
        refused={reason: count for reason, count in raw.refused.items() if count},
        remarks=(*raw.remarks, *recordings.remarks, *on_z, *doubts),
        bodies=diagnosed_bodies(equations, decision.model, recordings.unstated),
        equivalents=equivalents(equations, comparison, decision, contrasts),
    )


_CALM = ('no_mismatch', 'parameters_only')


def _remainders(equations: Equations, decision: Decision) -> tuple[Remainder, ...]:
    if decision.verdict != 'unexplained':
        return ()
    left = decision.model.mean_square / equations.power
    joints = [j for j in np.argsort(-left) if left[j] > REMAINDER_SHARE * left.max()]
    found = [learn_remainder(equations, decision.model.residual, int(j)) for j in joints[:2]]
    return tuple(r for r in found if r is not None)


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
    return Traces(
        equations.time, low(motion.position), low(motion.velocity), low(motion.effort),
        equations.d, comparison.parameters.residual, after, equations.noise, forces,
    )  # fmt: skip
