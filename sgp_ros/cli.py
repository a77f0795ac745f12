"""The `sgp` command: each sub-command is a name, its arguments and the function that they go to.

A function is loaded when its command runs, so that help comes at once. Its keyword arguments are
the names of the arguments of its command, with `out` and `progress` besides. Other packages add
commands by an entry point of the group `sgp_ros.commands`, see `AddCommand`.

Results go to stdout, remarks and progress to stderr. What a user can cause ends in one line on
stderr and exit status 2.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn, Protocol

# One BLAS thread, set before NumPy loads: live and replay then round alike, and the small
# matrices here are slower with more.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

from sgp_ros import __version__  # noqa: E402 - the environment above comes first
from sgp_ros.errors import ConfigError, SgpError  # noqa: E402 - the environment above comes first

GROUP = 'sgp_ros.commands'
"""Entry-point group of functions that take an `AddCommand` and add commands with it."""

BAD_INPUT = 2
INTERRUPTED = 130


class AddCommand(Protocol):
    """Adds one command and returns its parser, to which its arguments are added.

    >>> def add_commands(add: AddCommand) -> None:
    ...     parser = add('wait', 'time:sleep', 'Wait a while.', 'sgp wait 3')
    ...     parser.add_argument('seconds', type=float)
    """

    def __call__(
        self, name: str, function: str, summary: str, example: str
    ) -> argparse.ArgumentParser:
        """Add a command.

        Args:
            name: of the command.
            function: `module:function`, called with the arguments of the command as keywords,
                with `out`, the folder of the results, and with `progress`, to be called with the
                share that is done; it returns a mapping that JSON can hold.
            summary: one sentence.
            example: a call of the command.
        """


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, or 2 on bad input."""
    given = list(sys.argv[1:] if argv is None else argv)
    try:
        arguments = vars(_parser(given).parse_args(given))
    except ConfigError as error:
        sys.stderr.write(f'{error}\n')
        return BAD_INPUT
    name, function, prints_json = (arguments.pop(f'_{k}') for k in ('name', 'function', 'json'))
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        result = _load(function)(progress=Progress(name), **arguments)
    except (SgpError, OSError) as error:
        text = ' '.join(str(error).split())
        sys.stderr.write(f'sgp {name}: {text}\n')
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write(f'sgp {name}: interrupted\n')
        return INTERRUPTED
    if prints_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + '\n')
    return 0


class Progress:
    """A progress bar on stderr, where that is a terminal.

    Args:
        name: of the command, in front of the bar.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._shown = -1

    def __call__(self, share: float) -> None:
        """Show that `share` of the work, 0 to 1, is done."""
        percent = int(100.0 * min(max(share, 0.0), 1.0))
        if percent == self._shown or not sys.stderr.isatty():
            return
        self._shown = percent
        bar = ('#' * (2 * percent // 5)).ljust(40, '.')
        end = '\n' if percent == 100 else ''
        sys.stderr.write(f'\rsgp {self._name} [{bar}] {percent:3d} %{end}')
        sys.stderr.flush()


def _interrupt(_signal: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _load(place: str) -> Callable[..., Any]:
    module, _, function = place.partition(':')
    loaded: Callable[..., Any] = getattr(import_module(module), function)
    return loaded


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints fit one line."""

    def error(self, message: str) -> NoReturn:
        raise ConfigError(f'{self.prog}: {message}', '', f'see {self.prog} --help')


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    parser = _Parser(
        prog='sgp', description='Identify a robot with semi-parametric Gaussian processes.'
    )
    parser.add_argument('--version', action='version', version=f'sgp {__version__}')
    commands = parser.add_subparsers(dest='_name', required=True, metavar='COMMAND')

    def add(name: str, function: str, summary: str, example: str) -> argparse.ArgumentParser:
        parser = commands.add_parser(
            name, help=summary, description=summary, epilog=f'example: {example}'
        )
        parser.set_defaults(_function=function)
        parser.add_argument(
            '--out', metavar='DIR', type=Path, default=Path('out') / name,
            help='folder of the results (default: %(default)s)',
        )  # fmt: skip
        parser.add_argument('--json', dest='_json', action='store_true',
                            help='print the result as JSON, the last line of stdout')  # fmt: skip
        return parser

    for add_one in (
        _add_demo, _add_simulate, _add_replay, _add_identify, _add_diagnose, _add_import,
    ):  # fmt: skip
        add_one(add)
    if not given or given[0] not in commands.choices:  # looking for others takes its time
        _add_installed(add)
    return parser


def _add_installed(add: AddCommand) -> None:
    """Add the commands of other packages; one that cannot be loaded costs a remark."""
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP):
        try:
            entry.load()(add)
        except ImportError as error:  # noqa: PERF203 - each entry fails on its own
            sys.stderr.write(f'sgp: no commands of {entry.value}: {error}\n')


def _above(low: float, high: float = float('inf')) -> Callable[[str], float]:
    """Return what reads a finite number between two limits, both left out."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = low
        if not low < value < high:
            below = f' and below {high:g}' if high < float('inf') else ''
            raise argparse.ArgumentTypeError(f'{text!r}, expected a number above {low:g}{below}')
        return value

    return read


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'{text!r}, expected an integer from 0')
    return int(text)


def _add_recording(parser: argparse.ArgumentParser, metavar: str = 'BAG') -> None:
    parser.add_argument('bag', metavar=metavar, help='.mcap file, rosbag2 directory or ROS 1 .bag')
    parser.add_argument(
        '--robot', required=True, metavar='ROBOT', help='a built-in robot, a robot YAML or a URDF'
    )
    parser.add_argument('--joint-states', metavar='TOPIC', help='topic of the states')
    parser.add_argument('--command', metavar='TOPIC', help='topic of the commands')
    parser.add_argument(
        '--effort', choices=('auto', 'measured', 'commanded', 'state', 'command'), default='auto',
        help='the effort that acts; auto: the measured one where there is one (default: auto)',
    )  # fmt: skip


def _add_demo(add: AddCommand) -> None:
    parser = add(
        'demo', 'sgp_ros.apps.demo:run_demo',
        'Identify a simulated reaction wheel live over DDS, then prove that a replay agrees.',
        'sgp demo --duration 20 --out out/demo',
    )  # fmt: skip
    parser.add_argument('--duration', type=_above(0.0), default=20.0, metavar='S',
                        help='length [s]')  # fmt: skip
    parser.add_argument('--seed', type=_seed, default=0, metavar='N', help='seed')


def _add_simulate(add: AddCommand) -> None:
    parser = add(
        'simulate', 'sgp_ros.apps.simulation:run_simulation',
        'Write a recording of a simulated robot, built-in or from a URDF, and the truth about it.',
        'sgp simulate arm.urdf --effect coulomb_friction:joint=elbow,level=0.3 --sensor bits=14',
    )  # fmt: skip
    parser.add_argument('robot', metavar='ROBOT', help='a built-in robot, a URDF or a robot YAML')
    parser.add_argument('--duration', type=_above(0.0), default=20.0, metavar='S',
                        help='length [s]')  # fmt: skip
    parser.add_argument('--rate', type=_above(0.0), metavar='HZ', help='sampling rate')
    parser.add_argument('--seed', type=_seed, default=0, metavar='N', help='seed')
    parser.add_argument('--controller', metavar='NAME', help='what drives it')
    parser.add_argument(
        '--effect', dest='effects', action='append', default=[], metavar='NAME:joint=J,k=v',
        help='physics to add; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--physical', action='append', default=[], metavar='NAME=VALUE',
        help='another value of a physical parameter; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--sensor', dest='sensors', action='append', default=[], metavar='NAME=VALUE',
        help='such as bits=14, velocity=no, jitter=0.001, drop=0.005; may be repeated',
    )  # fmt: skip


def _add_replay(add: AddCommand) -> None:
    parser = add(
        'replay', 'sgp_ros.apps.replay:run_replay',
        'Run a recording through the online engine and report what it learned.',
        'sgp replay robot.mcap --robot linear_axis --out out/replay',
    )  # fmt: skip
    _add_recording(parser)
    parser.add_argument(
        '--params', metavar='YAML', help="ROS 2 parameter file (default: the robot's own)"
    )
    parser.add_argument('--model', metavar='NPZ', help='continue from a saved model')
    parser.add_argument('--frozen', dest='is_learning', action='store_false',
                        help='predict and score, do not learn')  # fmt: skip
    parser.add_argument('--truth', metavar='JSON', help='truth.json to compare with')


def _add_identify(add: AddCommand) -> None:
    parser = add(
        'identify', 'sgp_ros.apps.identify:run_identify',
        'Identify a robot from a whole recording, offline: filters, parameters, URDF, roll-outs.',
        'sgp identify arm.mcap --robot arm.urdf --test other.mcap --out out/identify',
    )  # fmt: skip
    _add_recording(parser)
    parser.add_argument('--test', dest='tests', action='append', default=[], metavar='BAG',
                        help='recording to score on; may be repeated')  # fmt: skip
    parser.add_argument('--holdout', choices=('tail', 'alternate'), default='tail',
                        help='part held out without --test (default: %(default)s)')  # fmt: skip
    parser.add_argument('--share', type=_above(0.0, 1.0), default=0.4, metavar='X',
                        help='how much of it (default: %(default)s)')  # fmt: skip
    parser.add_argument('--stretch', type=_above(0.0), default=6.0, metavar='S',
                        help='length of alternate stretches [s]')  # fmt: skip
    parser.add_argument('--cutoff', type=_above(0.0), metavar='HZ',
                        help='of the low-pass (default: chosen from the data)')  # fmt: skip
    parser.add_argument('--inputs', nargs='+', metavar='NAME',
                        help='what Z sees, such as own:velocity or every:velocity')  # fmt: skip


def _add_diagnose(add: AddCommand) -> None:
    parser = add(
        'diagnose', 'sgp_ros.apps.diagnose:run_diagnose',
        'Locate, name and model the physics that the nominal robot lacks.',
        'sgp diagnose real.mcap --robot robot.urdf --test real_test.mcap --out out/diagnose',
    )  # fmt: skip
    _add_recording(parser, 'REAL')
    parser.add_argument('--sim', metavar='SIM',
                        help='recording of the simulation, to check ROBOT with')  # fmt: skip
    parser.add_argument('--test', dest='tests', action='append', default=[], metavar='BAG',
                        help='held-out recording for the proof; may be repeated; without any, '
                        'a quarter of REAL is held out')  # fmt: skip


def _add_import(add: AddCommand) -> None:
    parser = add(
        'import', 'sgp_ros.apps.importing:run_import',
        'Turn a CSV, NPZ or MAT recording into MCAP.',
        'sgp import emps_id.csv --map config/import/emps.yaml --out out/import',
    )  # fmt: skip
    parser.add_argument('table', metavar='FILE', help='.csv, .npz or .mat')
    parser.add_argument('--map', dest='map_path', required=True, metavar='YAML',
                        help='columns and units')  # fmt: skip


if __name__ == '__main__':
    sys.exit(main())
