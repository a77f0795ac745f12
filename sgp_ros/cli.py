"""The `sgp` command: runs the function that belongs to a sub-command, see `apps.arguments`.

A function is loaded when its command runs, so that help comes at once. Its keyword arguments are
the names of the arguments of its command, with `out` and `progress` besides. Other packages add
commands by an entry point of the group `sgp_ros.commands`, see `AddCommand`.

Results go to stdout, remarks and progress to stderr; with `--json` the JSON has stdout for itself,
and the text goes to stderr. What a user can cause ends in one line on stderr and exit status 2;
what only a bug can cause in one line and status 70, or with `SGP_DEBUG=1` in its traceback.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, redirect_stdout, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

# One BLAS thread, set before NumPy loads: live and replay then round alike, and the small
# matrices here are slower with more.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

from sgp_ros import __version__  # noqa: E402 - the environment above comes first
from sgp_ros.apps.arguments import (  # noqa: E402 - as above
    COMMANDS,
    EXAMPLE,
    GROUPS,
    AddCommand,
)
from sgp_ros.apps.terminal import (  # noqa: E402 - as above
    BESIDE_INPUT,
    WITHOUT_RESULTS,
    mark_folder,
    require_own_folder,
    require_own_recording,
    strong,
)
from sgp_ros.errors import ConfigError, SgpError  # noqa: E402 - the environment above comes first

_LONGEST = 300
"""Characters of an internal error that are shown."""
GROUP = 'sgp_ros.commands'
"""Entry-point group of functions that take an `AddCommand` and add commands with it."""

TABLES = ('.csv', '.npz', '.mat', '.parquet', '.h5', '.json', '.jsonl')
MODELS = ('.urdf', '.xacro', '.xml', '.mjcf', '.sdf', '.yaml', '.yml')

BAD_INPUT = 2
INTERNAL_ERROR = 70
"""`EX_SOFTWARE` of sysexits.h."""
INTERRUPTED = 130
DEBUG = 'SGP_DEBUG'
"""Environment variable under which an internal error is raised, with its traceback."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, 2 on bad input, 70 on a bug."""
    given = list(sys.argv[1:] if argv is None else argv) or ['--help']
    try:
        parser = _parser(given)
        _complete(parser)
        arguments = vars(parser.parse_args(given))
    except ConfigError as error:
        sys.stderr.write(f'{_hint(given) or error}\n')
        return BAD_INPUT
    name, before = arguments['_name'], signal.signal(signal.SIGTERM, _interrupt)
    try:
        return _run(arguments)
    except BrokenPipeError:  # a reader such as `head` has seen enough
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:  # also while it cleans up
        sys.stderr.write(f'sgp {name}: interrupted\n')
        return INTERRUPTED
    except Exception as error:
        if os.environ.get(DEBUG):
            raise
        sys.stderr.write(f'sgp {name}: {_internal(error)}\n')
        return INTERNAL_ERROR
    finally:
        signal.signal(signal.SIGTERM, before)


def _internal(error: Exception) -> str:
    """Return one line on an error that only a bug can cause."""
    text = ' '.join(f'{type(error).__name__}: {error}'.split())
    text = f'{text[:_LONGEST]}...' if len(text) > _LONGEST else text
    return f'internal error: {text}; please report it with what {DEBUG}=1 prints'


def _run(arguments: dict[str, Any]) -> int:
    """Run a command with its parsed arguments and return its exit status."""
    name, function, prints_json, is_quiet, is_forced = (
        arguments.pop(f'_{k}') for k in ('name', 'function', 'json', 'quiet', 'force')
    )
    # Absurd numbers overflow; results are checked to be finite. Behind the filters of a caller.
    warnings.filterwarnings('ignore', category=RuntimeWarning, append=True)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a file name may be no text
        sys.stdout.reconfigure(errors='backslashreplace')
    out = arguments['out']
    is_new = False
    try:
        is_new = out is not None and not out.exists()
        _load('sgp_ros.scratch:sweep')()
        if name == BESIDE_INPUT:
            arguments['is_forced'] = is_forced
            if not is_forced:
                require_own_recording(arguments['table'], out)
        elif out is not None and not is_forced:
            require_own_folder(out)
        with _text_to(is_quiet=is_quiet, prints_json=prints_json):
            result = _load(function)(progress=Progress(name, is_quiet=is_quiet), **arguments)
        if out is not None and name != BESIDE_INPUT:
            mark_folder(out, name)
        is_new = False
        if prints_json:
            sys.stdout.write(json.dumps(result, allow_nan=False) + '\n')
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (SgpError, OSError) as error:
        text = ' '.join(str(error).split())
        sys.stderr.write(f'sgp {name}: {text}\n')
        return BAD_INPUT
    finally:
        if is_new:
            with suppress(OSError):  # there is none, or there are results in it
                out.rmdir()
    return 0


def _text_to(*, is_quiet: bool, prints_json: bool) -> AbstractContextManager[Any]:
    """Say where the text of a command goes: to stdout, beside the JSON, or nowhere."""
    if is_quiet:
        return redirect_stdout(_Nowhere())
    return redirect_stdout(sys.stderr) if prints_json else nullcontext()


class _Nowhere(io.TextIOBase):
    """A stream that keeps nothing."""

    def write(self, text: str) -> int:
        """Take a text as written."""
        return len(text)


def _complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks for completions, where argcomplete is installed."""
    if '_ARGCOMPLETE' in os.environ:
        with suppress(ImportError):
            import argcomplete

            argcomplete.autocomplete(parser)


def _hint(given: Sequence[str]) -> str:
    """Return what to do where a file was given instead of a command; empty otherwise."""
    if not given or given[0].startswith('-') or not Path(given[0]).exists():
        return ''
    place, ending = given[0], Path(given[0]).suffix.lower()
    if ending in TABLES:
        then = f'sgp import {place}'
    elif ending in MODELS:
        then = f'sgp simulate {place}, or give it to another command with --robot'
    else:
        then = f'sgp diagnose {place} --robot ROBOT.urdf'
    return f'sgp: {place} is a file, expected a command; try {then}'


class Progress:
    """A progress bar on stderr, where that is a terminal.

    Args:
        name: of the command, in front of the bar.
        is_quiet: whether nothing is shown.
    """

    def __init__(self, name: str, *, is_quiet: bool = False) -> None:
        self._name = name
        self._shown = -1
        self._is_shown = not is_quiet

    def __call__(self, share: float) -> None:
        """Show that `share` of the work, 0 to 1, is done."""
        percent = int(100.0 * min(max(share, 0.0), 1.0))
        if percent == self._shown or not (self._is_shown and sys.stderr.isatty()):
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


class _Sgp(_Parser):
    """The parser of `sgp` itself, whose help lists the commands by what they are for."""

    summaries: dict[str, str]

    def format_help(self) -> str:
        """Return the help: groups of commands, and an example that runs."""
        others = [name for name in self.summaries if name not in COMMANDS]
        lines = [self.description or '', '', 'usage: sgp COMMAND ..., sgp COMMAND --help', '']
        for title, names in [*GROUPS.items(), *[('More', others)] * bool(others)]:
            lines += [strong(title), *(f'  {name:10s} {self.summaries[name]}' for name in names)]
        return '\n'.join([*lines, '', EXAMPLE, ''])


def _parser(given: Sequence[str]) -> argparse.ArgumentParser:
    parser = _Sgp(prog='sgp', description='Find the physics that a robot has and its model lacks.')
    parser.summaries = {}
    parser.add_argument('--version', action='version', version=f'sgp {__version__}')
    commands = parser.add_subparsers(
        dest='_name', required=True, metavar='COMMAND', parser_class=_Parser, prog='sgp'
    )

    def add(name: str, function: str, summary: str, example: str) -> argparse.ArgumentParser:
        parser.summaries[name] = summary
        found = commands.add_parser(
            name, help=summary, description=summary, epilog=f'example: {example}'
        )
        found.set_defaults(_function=function, out=None, _force=False)
        if name not in WITHOUT_RESULTS:
            found.add_argument(
                '--out', metavar='DIR', type=Path, default=Path('out') / name,
                help='folder of the results, which are replaced (default: %(default)s)',
            )  # fmt: skip
            found.add_argument('--force', dest='_force', action='store_true',
                               help='write into DIR even if it contains other files')  # fmt: skip
        found.add_argument('--json', dest='_json', action='store_true',
                           help='print the result as JSON; text goes to stderr')  # fmt: skip
        found.add_argument('--quiet', dest='_quiet', action='store_true',
                           help='print errors only, no text and no progress')  # fmt: skip
        return found

    chosen = given[0] if given else ''
    if chosen in COMMANDS:
        COMMANDS[chosen](add)
    elif chosen != '--version':
        for add_one in COMMANDS.values():
            add_one(add)
        _add_installed(add)  # looking takes its time
    return parser


def _add_installed(add: AddCommand) -> None:
    """Add the commands of other packages; one that cannot be loaded costs a remark."""
    for place in _entry_points():
        try:
            _load(place)(add)
        except ImportError as error:  # noqa: PERF203 - each entry fails on its own
            sys.stderr.write(f'sgp: no commands of {place}: {error}\n')


def _entry_points() -> list[str]:
    """Return the functions of our group, `module:function`, of all installed packages.

    As `importlib.metadata` does, which takes as long to load as all else that help needs.
    """
    found: dict[str, str] = {}
    for folder in dict.fromkeys(sys.path):
        for path in sorted(Path(folder).glob('*-info/entry_points.txt')):
            _, _, ours = f'\n{path.read_text(encoding="utf-8")}'.partition(f'\n[{GROUP}]\n')
            for line in ours.partition('\n[')[0].splitlines():
                name, _, place = line.partition('=')
                if place:
                    found.setdefault(name.strip(), place.split('[')[0].strip())
    return list(found.values())


if __name__ == '__main__':
    sys.exit(main())
