"""Statuses of /diagnostics from what the engine counts, and of ~/parameters from what it found."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Mapping

import numpy as np

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.results import Counts, Estimate, ParameterEstimate
from sgp_ros.errors import MessageError
from sgp_ros.recordings.messages import Status
from sgp_ros.ros.verdict import OK, WARN, Arrivals, judge

_DURATIONS = 2000
_MEMORY = 100
_SURPRISING = 4.0


class Health:
    """What happened since the node started, as far as the engine does not know it.

    Attributes:
        seen_joints: names in the last joint states.
        last_fit: one sentence on the last fit of hyper-parameters.
        fit_since_s: when the fit that runs was handed out, on a steady clock [s]; None without.
        record_problem: why the record stopped; empty while all is well.
        failures, first_failure: errors that only a bug can cause, and the first of them with its
            event, for the log.
    """

    def __init__(self) -> None:
        self.seen_joints: tuple[str, ...] = ()
        self.last_fit = 'none yet'
        self.fit_since_s: float | None = None
        self.record_problem = ''
        self.failures, self.first_failure = 0, ''
        self._durations_s: deque[float] = deque(maxlen=_DURATIONS)
        self._unreadable = 0
        self._unreadable_reason = ''
        self._surprise: np.ndarray | None = None
        self._before: dict[str, int] = {}

    def note_push(self, duration_s: float) -> None:
        """Note how long the engine took for one event [s]."""
        self._durations_s.append(duration_s)

    def note_fit(self, fit: FitResult, refusal: str) -> None:
        """Note what a fit found, and why it was refused, empty if it was not."""
        gain = fit.log_evidence - fit.log_evidence_before
        self.last_fit = {
            '': f'log evidence rose by {gain:.3g} nat',
            'diverged': 'refused: diverged, nothing that it tried has a usable covariance',
            'no_better': f'refused: no better, its log evidence is {-gain:.3g} nat lower',
            'no_factor': 'refused: the buffer has no factor under what it found for some joint',
        }[refusal]

    def note_failure(self, failure: str) -> None:
        """Note an error that only a bug can cause; the engine goes on from before it."""
        self.failures += 1
        self.first_failure = self.first_failure or failure

    def note_error(self, error: Exception, place: str) -> None:
        """Note such an error at the edge of the node, with what it was about to do."""
        text = ' '.join(f'{type(error).__name__}: {error}'.split())
        self.note_failure(f'internal error in {place.strip("_")} ({text})')

    def note_unreadable(self, error: MessageError) -> None:
        """Note a message that is no sample."""
        self._unreadable += 1
        self._unreadable_reason = str(error)

    def note_estimates(self, estimates: Iterable[Estimate], target: str) -> None:
        """Follow the squared error over its predicted variance: 1 while the model holds."""
        for estimate in estimates:
            if estimate.is_scored:
                channel = getattr(estimate, target)
                ratio = (channel.measured - channel.mean) ** 2 / channel.raw_variance
                before = ratio if self._surprise is None else self._surprise
                self._surprise = before + (ratio - before) / _MEMORY

    def statuses(
        self, engine: Engine, node: str, elapsed_s: float, sources: Mapping[str, tuple[str, int]]
    ) -> list[Status]:
        """Return the statuses since the last call.

        Args:
            engine: whose counts and scores are told.
            node: name of the node, the prefix of every status.
            elapsed_s: since the last call [s].
            sources: full topic name and number of publishers of joint_states and command.
        """
        arrivals = self._arrivals(engine, sources)
        level, message = judge(arrivals)
        parts = [('samples', level, message, self._samples(engine.counts, arrivals, elapsed_s))]
        parts.append(('timing', OK, 'time the engine takes per message', self._timing()))
        parts.append(self._model(engine))
        parts += [self._fit(engine, j, name) for j, name in enumerate(engine.robot.joint_names)]
        if self.failures:
            text = f'{self.failures} internal errors, the first: {self.first_failure}'
            parts.append(('errors', WARN + 1, text, {'count': str(self.failures)}))
        if self.record_problem:
            parts.append(('record', WARN + 1, self.record_problem, {}))
        return [
            Status(f'{node}: {name}', level, message, engine.robot.name, values)
            for name, level, message, values in parts
        ]

    def _arrivals(self, engine: Engine, sources: Mapping[str, tuple[str, int]]) -> Arrivals:
        now = _flat(engine.counts, self._unreadable)
        new = {name: max(n - self._before.get(name, 0), 0) for name, n in now.items()}
        self._before = now
        return Arrivals(
            joint_states=sources['joint_states'][0],
            command=sources['command'][0],
            robot_joints=engine.robot.joint_names,
            publishers=sources['joint_states'][1],
            command_publishers=sources['command'][1],
            seen_joints=self.seen_joints,
            read=new['read'],
            estimated=new['estimated'],
            refused=_under('refused.', new),
            commands_read=new['commands_read'],
            commands_refused=_under('commands_refused.', new),
            unreadable=new['unreadable'],
            unreadable_reason=self._unreadable_reason,
        )

    def _samples(self, counts: Counts, arrivals: Arrivals, elapsed_s: float) -> dict[str, str]:
        rate = arrivals.read / elapsed_s if elapsed_s > 0.0 else 0.0
        totals = {name: str(n) for name, n in _flat(counts, self._unreadable).items()}
        return {'rate_hz': f'{rate:.2f}', 'used': str(counts.used), **totals}

    def _timing(self) -> dict[str, str]:
        if not self._durations_s:
            return {}
        ms = 1e3 * np.array(self._durations_s)
        p50, p99 = np.percentile(ms, (50, 99))
        return {
            'push_ms_p50': f'{p50:.4f}',
            'push_ms_p99': f'{p99:.4f}',
            'push_ms_max': f'{ms.max():.4f}',
        }

    def _model(self, engine: Engine) -> tuple[str, int, str, dict[str, str]]:
        config, counts, regression = engine.config, engine.counts, engine.estimator.regression
        message = 'predicts and learns'
        if not engine.is_ready:
            message = f'gathers the first {config.learning_initial} samples'
        elif not config.learning_enabled:
            message = 'predicts, does not learn'
        values = {
            'ready': str(int(engine.is_ready)),
            'learning': str(int(config.learning_enabled)),
            'buffer': str(engine.buffer_size),
            'budget': str(config.buffer_budget),
            'basis_unresolved': str(0 if regression is None else regression.unresolved),
            'delay_s': f'{engine.delay_s:.6f}',
            'held': str(counts.held),
            'refits': str(counts.refits),
            'refits_refused': str(counts.refits_refused),
            **{f'refits_refused.{why}': str(n) for why, n in counts.refits_refused_for.items()},
            'factor_checks': str(counts.factor_checks),
            'factor_drift': f'{counts.factor_drift:.3g}',
            'factor_rebuilt': str(counts.factor_rebuilt),
            'refit_running': self._running_fit(),
            'last_refit': self.last_fit,
        }
        return 'model', OK, message, values

    def _running_fit(self) -> str:
        if self.fit_since_s is None:
            return 'none'
        return f'for {time.perf_counter() - self.fit_since_s:.1f} s'

    def _fit(self, engine: Engine, j: int, joint: str) -> tuple[str, int, str, dict[str, str]]:
        scores = engine.scores()[joint]
        values = {
            f'{channel}.{name}': f'{getattr(score, name):.6g}'
            for channel, score in scores.items()
            for name in ('nmse', 'nlpd', 'coverage95', 'raw_coverage95', 'n')
        }
        target = scores.get(engine.robot.target)
        if target is None or self._surprise is None:
            return f'fit {joint}', OK, 'nothing scored yet', values
        surprise, drift = float(self._surprise[j]), engine.drift[j]
        values['surprise'] = f'{surprise:.4f}'
        values['drift'] = f'{drift.level:.4f}'
        message = f'nMSE {target.nmse:.3g}, coverage {100 * target.coverage95:.1f} %'
        weight = engine.process_weights().get(joint)
        if weight is not None:
            values['process_weight'] = f'{weight.value:.4f}'
            if weight.value < 0.5:
                message += (
                    f'; Z errs more than the physics alone and has weight {weight.value:.2f}'
                )
        is_wrong = surprise > _SURPRISING
        if is_wrong:
            message += f'; recent squared errors are {surprise:.1f} times what the model expects'
        if drift.is_drifting:
            message += (
                '; errors have grown beyond chance: the robot drifts or moves as never before'
            )
        return f'fit {joint}', WARN if is_wrong or drift.is_drifting else OK, message, values


def _flat(counts: Counts, unreadable: int) -> dict[str, int]:
    names = ('read', 'estimated', 'learned', 'scored', 'unlearnable', 'commands_read',
             'commands_used', 'clock_jumps')  # fmt: skip
    return {
        **{name: getattr(counts, name) for name in names},
        **{f'refused.{reason}': n for reason, n in counts.refused.items()},
        **{f'commands_refused.{reason}': n for reason, n in counts.commands_refused.items()},
        **{f'changes_refused.{reason}': n for reason, n in counts.changes_refused.items()},
        'unreadable': unreadable,
    }


def _under(prefix: str, counts: Mapping[str, int]) -> dict[str, int]:
    return {n.removeprefix(prefix): count for n, count in counts.items() if n.startswith(prefix)}


def parameter_statuses(engine: Engine) -> list[Status]:
    """Return one status per identified coefficient, its numbers plain enough to be plotted."""
    return [parameter_status(p, engine.robot.name) for p in engine.parameters()]


def parameter_status(parameter: ParameterEstimate, robot: str) -> Status:
    """Return the status of one coefficient of `robot`; no `std` where it is not identifiable."""
    values = {'value': repr(parameter.value)}
    if parameter.std is None:
        message = 'not determined by the motion so far'
    else:
        values['std'] = repr(parameter.std)
        message = f'{parameter.value:.6g} +- {1.96 * parameter.std:.2g} {parameter.unit} (95 %)'
    values['unit'] = parameter.unit
    values['identifiable'] = str(int(parameter.is_identifiable))
    if parameter.joint is not None:
        values['joint'] = parameter.joint
    return Status(parameter.name, 0, message, robot, values)
