"""The `sgp` command: runs the function that belongs to a sub-command, see `apps.arguments`.

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
from typing import Any, NoReturn

# One BLAS thread, set before NumPy loads: live and replay then round alike, and the small
# matrices here are slower with more.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

from sgp_ros import __version__  # noqa: E402 - the environment above comes first
from sgp_ros.apps.arguments import COMMANDS, AddCommand  # noqa: E402 - as above
from sgp_ros.errors import ConfigError, SgpError  # noqa: E402 - the environment above comes first

GROUP = 'sgp_ros.commands'
"""Entry-point group of functions that take an `AddCommand` and add commands with it."""

BAD_INPUT = 2
INTERRUPTED = 130


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

    for add_one in COMMANDS:
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


if __name__ == '__main__':
    sys.exit(main())
