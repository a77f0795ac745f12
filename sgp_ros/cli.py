"""The `sgp` command: each sub-command is a thin layer over one function of the package.

Results go to stdout, remarks and progress to stderr. What a user can cause ends in one line on
stderr and exit status 2.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

# One BLAS thread, set before NumPy loads: live and replay then round alike, and the small
# matrices here are slower with more.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

from sgp_ros import __version__  # noqa: E402 - the environment above comes first
from sgp_ros.apps import commands as run  # noqa: E402 - the environment above comes first
from sgp_ros.errors import SgpError  # noqa: E402 - the environment above comes first

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    Result = Mapping[str, Any]

BAD_INPUT = 2
INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0, or 2 on bad input."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        result = arguments.run(arguments)
    except (SgpError, OSError) as error:
        text = ' '.join(str(error).split())
        sys.stderr.write(f'sgp {arguments.command}: {text}\n')
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write(f'sgp {arguments.command}: interrupted\n')
        return INTERRUPTED
    if arguments.json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + '\n')
    return 0


def _interrupt(_signal: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='sgp', description='Identify a robot with semi-parametric Gaussian processes.'
    )
    parser.add_argument('--version', action='version', version=f'sgp {__version__}')
    commands = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    _add_demo(commands)
    _add_simulate(commands)
    _add_replay(commands)
    _add_identify(commands)
    _add_diagnose(commands)
    _add_import(commands)
    _add_reproduce(commands)
    _add_bench(commands)
    return parser


def _add(
    commands: Any,
    name: str,
    called: Callable[[argparse.Namespace], Result],
    summary: str,
    example: str,
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=summary, description=summary, epilog=f'example: {example}'
    )
    parser.set_defaults(run=called)
    parser.add_argument(
        '--out', metavar='DIR', type=Path, default=Path('out') / name,
        help='folder of the results (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--json', action='store_true', help='print the result as JSON in the last line of stdout'
    )
    return parser


def _add_topics(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--joint-states', metavar='TOPIC', help='topic of the states')
    parser.add_argument('--command', metavar='TOPIC', dest='command_topic',
                        help='topic of the commands')  # fmt: skip


def _add_demo(commands: Any) -> None:
    parser = _add(
        commands, 'demo', run.demo,
        'Identify a simulated reaction wheel live over DDS, then prove that a replay agrees.',
        'sgp demo --duration 20 --out out/demo',
    )  # fmt: skip
    parser.add_argument('--duration', type=float, default=20.0, metavar='S', help='length [s]')
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='seed of the simulation')


def _add_simulate(commands: Any) -> None:
    parser = _add(
        commands, 'simulate', run.simulate,
        'Write a recording of a simulated robot, built-in or from a URDF, and the truth about it.',
        'sgp simulate arm.urdf --effect coulomb_friction:joint=elbow,level=0.3 --sensor bits=14',
    )  # fmt: skip
    parser.add_argument(
        'robot',
        metavar='ROBOT',
        help='a built-in robot, a URDF, or a robot YAML such as robot_diagnosed.yaml',
    )
    parser.add_argument('--duration', type=float, default=20.0, metavar='S', help='length [s]')
    parser.add_argument('--rate', type=float, default=None, metavar='HZ', help='sampling rate')
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='seed')
    parser.add_argument('--controller', default=None, metavar='NAME', help='what drives it')
    parser.add_argument(
        '--effect', action='append', default=[], metavar='NAME:joint=J,k=v',
        help='physics to add; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--physical', action='append', default=[], metavar='NAME=VALUE',
        help='another value of a physical parameter; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--sensor', action='append', default=[], metavar='NAME=VALUE',
        help='such as bits=14, velocity=no, jitter=0.001, drop=0.005; may be repeated',
    )  # fmt: skip


def _add_replay(commands: Any) -> None:
    parser = _add(
        commands, 'replay', run.replay,
        'Run a recording through the online engine and report what it learned.',
        'sgp replay robot.mcap --robot linear_axis --out out/replay',
    )  # fmt: skip
    parser.add_argument('bag', metavar='BAG', help='.mcap file, rosbag2 directory or ROS 1 .bag')
    parser.add_argument(
        '--robot', required=True, metavar='ROBOT', help='a built-in robot, a robot YAML or a URDF'
    )
    parser.add_argument(
        '--params', metavar='YAML', help="ROS 2 parameter file (default: the robot's own)"
    )
    _add_topics(parser)
    parser.add_argument('--model', metavar='NPZ', help='continue from a saved model')
    parser.add_argument('--frozen', action='store_true', help='predict and score, do not learn')
    parser.add_argument('--truth', metavar='JSON', help='truth.json to compare with')


def _add_identify(commands: Any) -> None:
    parser = _add(
        commands, 'identify', run.identify,
        'Identify a robot from a whole recording, offline: filters, parameters, URDF, roll-outs.',
        'sgp identify arm.mcap --robot arm.urdf --test other.mcap --out out/identify',
    )  # fmt: skip
    parser.add_argument('bag', metavar='BAG', help='.mcap file, rosbag2 directory or ROS 1 .bag')
    parser.add_argument(
        '--robot', required=True, metavar='ROBOT', help='a built-in robot, a robot YAML or a URDF'
    )
    parser.add_argument('--test', action='append', default=[], metavar='BAG',
                        help='recording to score on; may be repeated')  # fmt: skip
    parser.add_argument('--holdout', choices=('tail', 'alternate'), default='tail',
                        help='part held out without --test (default: %(default)s)')  # fmt: skip
    parser.add_argument('--share', type=float, default=0.4, metavar='X',
                        help='how much of it (default: %(default)s)')  # fmt: skip
    parser.add_argument('--stretch', type=float, default=6.0, metavar='S',
                        help='length of alternate stretches [s]')  # fmt: skip
    parser.add_argument('--cutoff', type=float, default=None, metavar='HZ',
                        help='of the low-pass (default: chosen from the data)')  # fmt: skip
    parser.add_argument('--inputs', nargs='+', metavar='NAME', default=None,
                        help='what Z sees, such as own:velocity or every:velocity')  # fmt: skip
    parser.add_argument('--effort', choices=('auto', 'state', 'command'), default='auto',
                        help='where efforts come from (default: %(default)s)')  # fmt: skip
    _add_topics(parser)


def _add_diagnose(commands: Any) -> None:
    parser = _add(
        commands, 'diagnose', run.diagnose,
        'Locate, name and model the physics that the nominal robot lacks.',
        'sgp diagnose real.mcap --robot robot.urdf --test real_test.mcap --out out/diagnose',
    )  # fmt: skip
    parser.add_argument('bag', metavar='REAL', help='.mcap file, rosbag2 directory or ROS 1 .bag')
    parser.add_argument('--robot', required=True, metavar='ROBOT',
                        help='a URDF, or a robot YAML with one')  # fmt: skip
    parser.add_argument('--sim', metavar='SIM',
                        help='recording of the simulation, to check ROBOT with')  # fmt: skip
    parser.add_argument('--test', action='append', default=[], metavar='BAG',
                        help='held-out recording for the proof; may be repeated; without any, '
                        'a quarter of REAL is held out')  # fmt: skip
    _add_topics(parser)


def _add_import(commands: Any) -> None:
    parser = _add(
        commands, 'import', run.import_recording,
        'Turn a CSV, NPZ or MAT recording into MCAP.',
        'sgp import emps_id.csv --map config/import/emps.yaml --out out/import',
    )  # fmt: skip
    parser.add_argument('file', metavar='FILE', help='.csv, .npz or .mat')
    parser.add_argument('--map', required=True, metavar='YAML', help='columns and units')


def _add_reproduce(commands: Any) -> None:
    parser = _add(
        commands, 'reproduce', run.reproduce,
        'Run the experiments of the paper, with every method through one interface.',
        'sgp reproduce toy --seeds 20 --out out/reproduce',
    )  # fmt: skip
    parser.add_argument('experiment', metavar='NAME', nargs='?', default='all',
                        help='toy, reaction-wheel, arm, choices or all (default)')  # fmt: skip
    parser.add_argument('--seeds', type=int, default=None, metavar='N',
                        help='worlds per experiment (default: 20)')  # fmt: skip
    parser.add_argument('--quick', action='store_true', help='few seeds, under two minutes')


def _add_bench(commands: Any) -> None:
    parser = _add(
        commands, 'bench', run.bench,
        "Measure speed and memory beside rivals and the machine's limit.",
        'sgp bench step --out out/bench',
    )  # fmt: skip
    parser.add_argument('names', metavar='NAME', nargs='*',
                        help='step or evidence (default: all)')  # fmt: skip
    parser.add_argument('--quick', action='store_true', help='small sizes, under a minute')


if __name__ == '__main__':
    sys.exit(main())
