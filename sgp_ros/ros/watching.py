"""`sgp watch`: the status of a running node, as a table in the terminal."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.optional import optional_package
from sgp_ros.recordings.messages import Status
from sgp_ros.report.layouts import write_live_layouts

_TURN_S, _REFRESH_S = 0.1, 0.5
_MOST_PARAMETERS = 24
_COLOURS = ('green', 'yellow', 'red', 'red')
_NAMES = ('OK', 'WARN', 'ERROR', 'STALE')


class Picture:
    """The last words of one node.

    Args:
        node: full name, such as `/left/sgp_node`.

    Attributes:
        statuses: of /diagnostics, by what follows the name of the node.
        parameters: of ~/parameters, by name.
        others: nodes of this package that were heard besides.
    """

    def __init__(self, node: str) -> None:
        self._prefix = f'{node.strip("/")}: '
        self.node = node
        self.statuses: dict[str, Status] = {}
        self.parameters: dict[str, Status] = {}
        self.others: set[str] = set()

    def hear(self, message: Any) -> None:
        """Take a message of /diagnostics."""
        if any(entry.name == f'{self._prefix}samples' for entry in message.status):
            self.statuses = {}  # this is all that holds now
        for entry in message.status:
            status = _status(entry)
            if status.name.startswith(self._prefix):
                self.statuses[status.name.removeprefix(self._prefix)] = status
            elif status.name.endswith(': samples'):
                self.others.add('/' + status.name.removesuffix(': samples'))

    def hear_parameters(self, message: Any) -> None:
        """Take a message of ~/parameters."""
        self.parameters = {entry.name: _status(entry) for entry in message.status}

    @property
    def is_known(self) -> bool:
        """Whether there is something to show: a model, or a node that waits for its robot."""
        return {'model', 'samples'} <= set(self.statuses) or 'robot' in self.statuses

    def values(self, name: str) -> Mapping[str, str]:
        """Return the values of a status, empty before it came."""
        found = self.statuses.get(name)
        return {} if found is None else found.values


def run_watch(
    node: str, wait: float, layouts: str | None, out: Path | None,
    progress: Callable[[float], None], *, once: bool,
) -> dict[str, Any]:  # fmt: skip
    """Show a node until Ctrl-C.

    Args:
        node: full name.
        wait: how long to wait for its first word [s].
        layouts: folder for layouts of plotting tools; None for none.
        out: of every command; not used.
        progress: likewise.
        once: print one picture and end.

    Returns:
        What was shown last.

    Raises:
        ConfigError: no ROS, no rich, or no word of the node.
    """
    del out, progress
    console = optional_package('rich.console', 'for sgp watch', 'watch').Console()
    live = optional_package('rich.live', 'for sgp watch', 'watch')
    picture = Picture(node)
    with _listening(picture) as turn:
        end = time.monotonic() + wait
        while (
            not {'model', 'samples'} <= set(picture.statuses) and 'robot' not in picture.statuses
        ):
            turn()
            if time.monotonic() > end:
                others = f'nodes there: {sorted(picture.others)}' if picture.others else (
                    'is the node running?'
                )  # fmt: skip
                raise ConfigError(
                    f'nothing from {node} on /diagnostics within {wait:g} s', '',
                    f'{others}; check ROS_DOMAIN_ID and --node NAME',
                )  # fmt: skip
        if layouts is not None:
            _settle(picture, turn)
            joints = [n.removeprefix('fit ') for n in picture.statuses if n.startswith('fit ')]
            Path(layouts).mkdir(parents=True, exist_ok=True)
            write_live_layouts(Path(layouts), node, joints, list(picture.parameters))
        if once:
            _settle(picture, turn)
            console.print(dashboard(picture))
        else:
            with (
                live.Live(
                    dashboard(picture), console=console, screen=sys.stdout.isatty()
                ) as shown,
                contextlib.suppress(KeyboardInterrupt),
            ):
                _refresh(picture, turn, shown)
    return {name: dict(status.values) for name, status in picture.statuses.items()}


def _settle(picture: Picture, turn: Callable[[], None]) -> None:
    """Hear the latched parameters too, where there are any."""
    end = time.monotonic() + 2.0 * _REFRESH_S
    while not picture.parameters and time.monotonic() < end:
        turn()


def _refresh(picture: Picture, turn: Callable[[], None], shown: Any) -> None:
    drawn = time.monotonic()
    while True:
        turn()
        if time.monotonic() - drawn >= _REFRESH_S:
            drawn = time.monotonic()
            shown.update(dashboard(picture))


@contextlib.contextmanager
def _listening(picture: Picture) -> Iterator[Callable[[], None]]:
    """Yield what lets messages pass."""
    rclpy = optional_package('rclpy', 'for sgp watch', 'wheels')
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile

    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node = rclpy.create_node('sgp_watch', context=context, start_parameter_services=False)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(DiagnosticArray, '/diagnostics', picture.hear, 10)
        topic = f'/{picture.node.strip("/")}/parameters'
        node.create_subscription(DiagnosticArray, topic, picture.hear_parameters, kept)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        yield lambda: executor.spin_once(timeout_sec=_TURN_S)
        node.destroy_node()
    finally:
        context.try_shutdown()


def dashboard(picture: Picture) -> Any:
    """Return a picture for rich to print."""
    group = optional_package('rich.console', 'for sgp watch', 'watch').Group
    parts = [_head(picture), _joints(picture)]
    if picture.parameters:
        parts.append(_parameters(picture))
    return group(*parts, _remarks(picture))


def _head(picture: Picture) -> Any:
    samples, timing = picture.values('samples'), picture.values('timing')
    model = picture.statuses.get('model')
    robot = next((s.hardware_id for s in picture.statuses.values() if s.hardware_id), '?')
    words = [f'{picture.node}', f'robot {robot}', 'waiting' if model is None else model.message]
    numbers = [
        f'{samples.get("rate_hz", "?")} Hz',
        f'{samples.get("used", "?")} states used, {samples.get("lost", "?")} lost',
        f'delay {timing.get("delay_s_p50", timing.get("delay_s_chosen", "?"))} s',
        f'{timing.get("callback_ms_p99", "?")} ms p99 per message',
    ]
    return _text(f'{", ".join(words)}\n{", ".join(numbers)}', 'bold')


def _joints(picture: Picture) -> Any:
    table = _table('joint', 'nMSE', 'recent', 'coverage 95 %', 'drift', 'error / band', 'alarm')
    for name, status in picture.statuses.items():
        if not name.startswith('fit '):
            continue
        joint, values = name.removeprefix('fit '), status.values
        monitor = picture.values(f'monitor {joint}')
        channel = 'effort' if 'effort.nmse' in values else 'acceleration'
        table.add_row(
            joint,
            _number(values.get(f'{channel}.nmse')),
            _number(values.get('recent_nmse')),
            _number(values.get(f'{channel}.coverage95')),
            _number(values.get('drift')),
            _number(monitor.get('ratio')),
            'ALARM' if monitor.get('alarm') == '1' else '',
            style=_COLOURS[status.level] if status.level else None,
        )
    return table


def _parameters(picture: Picture) -> Any:
    table = _table('parameter', 'value', '+- 95 %', 'unit')
    for name, status in list(picture.parameters.items())[:_MOST_PARAMETERS]:
        values = status.values
        half = 1.96 * float(values['std']) if 'std' in values else None
        table.add_row(
            name, _number(values.get('value')), 'undetermined' if half is None else f'{half:.2g}',
            values.get('unit', ''), style='dim' if half is None else None,
        )  # fmt: skip
    more = len(picture.parameters) - _MOST_PARAMETERS
    if more > 0:
        table.add_row(f'... {more} more', '', '', '')
    return table


def _remarks(picture: Picture) -> Any:
    lines = [
        (f'{_NAMES[s.level]}  {s.message}', _COLOURS[s.level])
        for s in picture.statuses.values()
        if s.level
    ]
    diagnosis = picture.statuses.get('diagnosis')
    if diagnosis is not None and not diagnosis.level:
        lines.append((f'diagnosis  {diagnosis.message}', 'cyan'))
    group = optional_package('rich.console', 'for sgp watch', 'watch').Group
    return group(*(_text(line, style) for line, style in lines or [('no problems', 'green')]))


def _table(*columns: str) -> Any:
    table = optional_package('rich.table', 'for sgp watch', 'watch').Table()
    for i, column in enumerate(columns):
        table.add_column(column, justify='right' if 0 < i < len(columns) - 1 else 'left')
    return table


def _text(words: str, style: str) -> Any:
    return optional_package('rich.text', 'for sgp watch', 'watch').Text(words, style=style)


def _number(text: str | None) -> str:
    return '' if text is None else f'{float(text):.4g}'


def _status(entry: Any) -> Status:
    level = entry.level[0] if isinstance(entry.level, bytes) else int(entry.level)
    values = {pair.key: pair.value for pair in entry.values}
    return Status(entry.name, min(level, 3), entry.message, entry.hardware_id, values)
