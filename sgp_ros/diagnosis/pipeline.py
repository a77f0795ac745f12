"""The whole chain: compare, locate, explain, decide, model, prove."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from sgp_ros.batch.acceptance import USUAL
from sgp_ros.diagnosis.compare.equations import Equations, make_equations
from sgp_ros.diagnosis.compare.trajectory import choose_bandwidth, collect
from sgp_ros.diagnosis.compare.velocity_sensor import sensor_lags
from sgp_ros.diagnosis.criteria import REMAINDER_SHARE
from sgp_ros.diagnosis.decide.certainty import certainty_of, probabilities
from sgp_ros.diagnosis.decide.decision import Decision, decide
from sgp_ros.diagnosis.decide.equivalence import Contrasts, equivalents
from sgp_ros.diagnosis.explain.fitted_model import Model
from sgp_ros.diagnosis.explain.hypotheses import Competition, compete
from sgp_ros.diagnosis.findings import alternatives, asserted, parameter_errors
from sgp_ros.diagnosis.locate.bands import bands
from sgp_ros.diagnosis.locate.dependence import dependences
from sgp_ros.diagnosis.locate.remainder import Remainder, learn_remainder
from sgp_ros.diagnosis.prove.held_out import keep_back
from sgp_ros.diagnosis.prove.prediction import FinalModel, diagnosed_bodies
from sgp_ros.diagnosis.prove.proof import prove
from sgp_ros.diagnosis.result import Band, Dependence, Diagnosis, Traces
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event
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
        RecordingError: too little motion, or none of the joints.
    """
    raw = collect(events, robot, stated, config)
    held = {stem: collect(test, robot, stated, config) for stem, test in tests.items()}
    raw, kept, remarks = keep_back(raw) if holds_out else (raw, {}, ())
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    competition = compete(equations, lambda share: progress(0.05 + 0.85 * share))
    decision = decide(equations, competition)
    lags = [lag for lag in sensor_lags(raw, equations) if lag.is_physics]
    remainders = _remainders(equations, decision)
    final = FinalModel(decision.model, competition.nominal, equations, remainders)
    contrasts = Contrasts(equations, decision.model)
    recordings = {'train': raw, **kept, **held}
    proofs = {stem: prove(final, part, tree) for stem, part in recordings.items()}
    chances = probabilities(equations, competition, decision, contrasts)
    depends, seen = _located(equations, competition.base.residual)
    findings, forces = asserted(equations, decision, lags, remainders, chances, depends)
    progress(1.0)
    return Diagnosis(
        robot=robot.name,
        joints=tree.moving_names,
        units=tuple('N' if p else 'N m' for p in tree.is_prismatic[: tree.size]),
        verdict='missing_physics' if lags and decision.verdict in _CALM else decision.verdict,
        certainty=certainty_of(findings, decision, equations, competition),
        findings=findings,
        alternatives=alternatives(decision, chances),
        parameter_errors=parameter_errors(equations, decision.model),
        proofs=proofs,
        predictions={stem: final.predict(part, tree) for stem, part in held.items()},
        dependences=depends,
        bands=seen,
        traces=_traces(equations, competition, decision.model, remainders, forces),
        cutoff_hz=equations.filter.cutoff,
        rate_hz=1.0 / (raw.step * equations.filter.decimation),
        rows=len(equations.d),
        refused={reason: count for reason, count in raw.refused.items() if count},
        remarks=(*raw.remarks, *remarks),
        bodies=diagnosed_bodies(equations, decision.model),
        equivalents=equivalents(equations, competition, decision, contrasts),
    )


_CALM = ('no_mismatch', 'parameters_only')


def _located(
    equations: Equations, residual: np.ndarray
) -> tuple[tuple[Dependence, ...], tuple[Band, ...]]:
    depends = dependences(equations, residual)
    return depends, bands(equations, residual, depends)


def _remainders(equations: Equations, decision: Decision) -> tuple[Remainder, ...]:
    if decision.verdict != 'unexplained':
        return ()
    left = decision.model.mean_square / equations.power
    joints = [j for j in np.argsort(-left) if left[j] > REMAINDER_SHARE * left.max()]
    found = [learn_remainder(equations, decision.model.residual, int(j)) for j in joints[:2]]
    return tuple(r for r in found if r is not None)


def _traces(
    equations: Equations,
    competition: Competition,
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
        equations.d, competition.parameters.residual, after, equations.noise, forces,
    )  # fmt: skip
