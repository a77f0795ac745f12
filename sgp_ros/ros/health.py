"""Statuses of /diagnostics on what arrives, how long it takes, and the state of the model."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping

import numpy as np

from sgp_ros.engine.engine import Engine
from sgp_ros.engine.fitting import FitResult
from sgp_ros.engine.joint_merging import JointMerger, Source
from sgp_ros.engine.results import Counts
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import MessageError
from sgp_ros.recordings.command_types import FLOAT64_ARRAY
from sgp_ros.recordings.messages import Status
from sgp_ros.ros.verdict import ERROR, OK, Arrivals, judge

_DURATIONS = 2000
_MOST_NAMES, _MOST_TEXT = 200, 400
"""Joints and characters of a message that are remembered: it may hold any number of them."""
_LONGEST_DELAY_S = 60.0


class Health:
    """Health of the node since its start, as far as the engine does not know it.

    Args:
        merger: of the joint states, which counts what came and what is missing.
        command_type: as the setting `command.type`.

    Attributes:
        seen_joints: names in the last joint states.
        without_effort: joints of the robot without a finite effort in the last message that named
            them.
        last_fit: one sentence on the last fit of hyper-parameters.
        fit_since_s: when the fit that runs was handed out, on a steady clock [s]; None without.
        record_problem, unrecorded: why the record stopped, empty while all is well, and how many
            events are missing since.
        failures, first_failure: errors that only a bug can cause, and the first of them with its
            event, for the log.
    """

    def __init__(self, merger: JointMerger, command_type: str = FLOAT64_ARRAY) -> None:
        self._merger = merger
        self._command_type = command_type
        self.without_effort: tuple[str, ...] = ()
        self.seen_joints: tuple[str, ...] = ()
        self.last_fit = 'none yet'
        self.fit_since_s: float | None = None
        self.record_problem, self.unrecorded = '', 0
        self.failures, self.first_failure = 0, ''
        self._durations_s: deque[float] = deque(maxlen=_DURATIONS)
        self._processor_s: deque[float] = deque(maxlen=_DURATIONS)
        self._callbacks_s: deque[float] = deque(maxlen=_DURATIONS)
        self._callbacks_cpu_s: deque[float] = deque(maxlen=_DURATIONS)
        self._delays_s: deque[float] = deque(maxlen=_DURATIONS)
        self._unreadable = 0
        self._unreadable_reason = ''
        self._before: dict[str, int] = {}
        self._sources_before: dict[frozenset[int], tuple[int, int]] = {}

    def note_joints(self, sample: JointSample) -> None:
        """Note what a message named, and which of the robot's joints in it had no effort."""
        self.seen_joints = sample.names[:_MOST_NAMES]
        unknown = set(sample.names)
        if sample.effort is not None:
            pairs = zip(sample.names, np.isnan(sample.effort).tolist(), strict=True)
            unknown = {name for name, is_unknown in pairs if is_unknown}
        if unknown or self.without_effort:
            kept = set(self.without_effort).difference(sample.names) | unknown
            self.without_effort = tuple(n for n in self._merger.joints if n in kept)

    def note_push(self, duration_s: float, processor_s: float) -> None:
        """Note how long the engine took for one event [s], and its processor time of that [s]."""
        self._durations_s.append(duration_s)
        self._processor_s.append(processor_s)

    def note_callback(self, duration_s: float, processor_s: float) -> None:
        """Note the time of a whole message, from its receipt to the last topic; as `note_push`."""
        self._callbacks_s.append(duration_s)
        self._callbacks_cpu_s.append(processor_s)

    def note_delay(self, delay_s: float) -> None:
        """Note the time from the stamp of a state to the publication of its prediction [s]."""
        if abs(delay_s) < _LONGEST_DELAY_S:  # else the stamps are of another clock
            self._delays_s.append(delay_s)

    def note_fit(self, fit: FitResult, refusal: str) -> None:
        """Note what a fit found, and why it was refused, empty if it was not."""
        gain = fit.log_evidence - fit.log_evidence_before
        self.last_fit = {
            '': f'log evidence rose by {gain:.3g} nat',
            'diverged': 'refused: the fit diverged, no usable covariance was found',
            'no_better': 'refused: it predicts left-out samples worse'
            if fit.is_worse
            else f'refused: no improvement, log evidence {-gain:.3g} nat lower',
            'outdated': 'refused: outdated, its data have been forgotten',
            'no_factor': 'refused: the buffer is singular with the new hyper-parameters',
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
        """Note a message that is not a sample."""
        self._unreadable += 1
        self._unreadable_reason = str(error)[:_MOST_TEXT]

    def statuses(
        self,
        engine: Engine,
        node: str,
        elapsed_s: float,
        sources: Mapping[str, tuple[str, tuple[str, ...]]],
    ) -> list[Status]:
        """Return the statuses since the last call.

        Args:
            engine: whose counts and scores are reported.
            node: name of the node, the prefix of every status.
            elapsed_s: since the last call [s].
            sources: full topic name and names of the publishers of joint_states and command.
        """
        arrivals = self._arrivals(engine, sources)
        level, message = judge(arrivals)
        parts = [('samples', level, message, self._samples(engine.counts, arrivals, elapsed_s))]
        parts.append(('timing', OK, *self._timing(engine)))
        parts.append(self._model(engine))
        if self.failures:
            text = (
                f'{self.failures} internal errors, the first: {self.first_failure}; please report '
                'it, with the record'
            )
            parts.append(('errors', ERROR, text, {'count': str(self.failures)}))
        if self.record_problem:
            values = {'unrecorded': str(self.unrecorded)}
            text = (
                f'{self.record_problem}, {self.unrecorded} events are missing; free disk space '
                'and restart the node'
            )
            parts.append(('record', ERROR, text, values))
        return [
            Status(f'{node}: {name}', level, message, engine.robot.name, values)
            for name, level, message, values in parts
        ]

    def _arrivals(
        self, engine: Engine, sources: Mapping[str, tuple[str, tuple[str, ...]]]
    ) -> Arrivals:
        now = self._totals(engine.counts)
        publishers = sources['joint_states'][1]
        self._merger.looks_for_returns = len(publishers) > 1
        new = {name: max(n - self._before.get(name, 0), 0) for name, n in now.items()}
        self._before = now
        found = Arrivals(
            joint_states=sources['joint_states'][0],
            command=sources['command'][0],
            robot_joints=engine.robot.joint_names,
            publishers=publishers,
            command_publishers=len(sources['command'][1]),
            command_type=self._command_type,
            seen_joints=self.seen_joints,
            without_effort=self.without_effort,
            missing_joints=self._merger.missing,
            shared_joints=self._merger.shared if len(publishers) > 1 else (),
            silent_joints=self._joints_of(lambda source, received, _: source.received == received),
            losing_joints=self._joints_of(lambda source, _, lost: source.missing.count > lost),
            received=new['messages'],
            lost=new['lost'],
            read=new['read'],
            estimated=new['estimated'],
            refused=_under('refused.', new),
            commands_read=new['commands_read'],
            commands_refused=_under('commands_refused.', new),
            unreadable=new['unreadable'],
            unreadable_reason=self._unreadable_reason,
        )
        sources_now = self._merger.sources.items()
        self._sources_before = {k: (s.received, s.missing.count) for k, s in sources_now}
        return found

    def _joints_of(self, is_meant: Callable[[Source, int, int], bool]) -> tuple[str, ...]:
        """Return the joints of sources, judged by what they had received and lost before."""
        merger, before = self._merger, self._sources_before
        joints = {
            joint
            for key, source in merger.sources.items()
            if is_meant(source, *before.get(key, (0, 0)))
            for joint in source.owned
        }
        return tuple(merger.joints[joint] for joint in sorted(joints))

    def _samples(self, counts: Counts, arrivals: Arrivals, elapsed_s: float) -> dict[str, str]:
        rate = arrivals.read / elapsed_s if elapsed_s > 0.0 else 0.0
        totals = {name: str(n) for name, n in self._totals(counts).items()}
        return {'rate_hz': f'{rate:.2f}', 'used': str(counts.used), **totals}

    def _totals(self, counts: Counts) -> dict[str, int]:
        merger = self._merger
        received = sum(source.received for source in merger.sources.values()) + merger.foreign
        return {
            **_flat(counts, self._unreadable),
            'messages': received,
            'lost': merger.lost,
            'pauses': sum(source.pauses for source in merger.sources.values()),
            'of_other_joints': merger.foreign,
            'unmatched': merger.unmatched,
        }

    def _timing(self, engine: Engine) -> tuple[str, dict[str, str]]:
        """Return what the settings make a prediction wait, and what was measured."""
        chosen_s = engine.config.reorder_window + engine.delay_s
        values = {'delay_s_chosen': f'{chosen_s:.4f}'}
        for name, times_s, unit in (
            ('callback_ms', self._callbacks_s, 1e3),
            ('callback_cpu_ms', self._callbacks_cpu_s, 1e3),
            ('push_ms', self._durations_s, 1e3), ('push_cpu_ms', self._processor_s, 1e3),
            ('delay_s', self._delays_s, 1.0),
        ):  # fmt: skip
            if times_s:
                times = unit * np.array(times_s)
                p50, p99 = np.percentile(times, (50, 99))
                values |= {f'{name}_p50': f'{p50:.4f}', f'{name}_p99': f'{p99:.4f}'}
                values[f'{name}_max'] = f'{times.max():.4f}'
        message = (
            f'predictions come {chosen_s:.3f} s after their stamps (reorder_window and half of '
            'filter.window), plus computing time'
        )
        return message, values

    def _model(self, engine: Engine) -> tuple[str, int, str, dict[str, str]]:
        config, counts, regression = engine.config, engine.counts, engine.estimator.regression
        message = 'predicting and learning'
        if not engine.is_ready:
            message = f'collecting the first {config.learning_initial} samples'
        elif not config.learning_enabled:
            message = 'predicting, not learning'
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


def _flat(counts: Counts, unreadable: int) -> dict[str, int]:
    names = ('read', 'estimated', 'learned', 'scored', 'unlearnable', 'commands_read',
             'commands_used', 'implausible', 'reverted', 'clock_jumps')  # fmt: skip
    return {
        **{name: getattr(counts, name) for name in names},
        **{f'refused.{reason}': n for reason, n in counts.refused.items()},
        **{f'commands_refused.{reason}': n for reason, n in counts.commands_refused.items()},
        **{f'changes_refused.{reason}': n for reason, n in counts.changes_refused.items()},
        'unreadable': unreadable,
    }


def _under(prefix: str, counts: Mapping[str, int]) -> dict[str, int]:
    return {n.removeprefix(prefix): count for n, count in counts.items() if n.startswith(prefix)}
