"""The commands of `sgp`: each is a name, its arguments and the function that they go to."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Protocol

from sgp_ros.physics.example import example_effect


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


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f'{text!r}, expected an integer from 1')
    return int(text)


def _add_recording(
    parser: argparse.ArgumentParser, metavar: str = 'BAG', several: str | None = None
) -> None:
    """Add the inputs of a robot; `several` states the meaning of several recordings."""
    parser.add_argument('bag', metavar=metavar, nargs=None if several is None else '+',
                        help=f'.mcap file, rosbag2 directory or ROS 1 .bag{several or ""}'
                        )  # fmt: skip
    parser.add_argument(
        '--robot', required=True, metavar='ROBOT', help='built-in robot, robot YAML or model file'
    )
    parser.add_argument('--joint-states', metavar='TOPIC', help='topic of the joint states')
    parser.add_argument('--command', metavar='TOPIC', help='topic of the commands')
    parser.add_argument(
        '--effort', choices=('auto', 'measured', 'commanded', 'state', 'command'), default='auto',
        help='source of the effort; auto: measured if available (default: auto)',
    )  # fmt: skip


def _add_gains(parser: argparse.ArgumentParser, *, has_sim: bool = True) -> None:
    if has_sim:
        parser.add_argument('--sim', metavar='SIM', help='recording or model file of the '
                            'simulation to compare with')  # fmt: skip
    parser.add_argument(
        '--gains', metavar='YAML', help='kp and kd by joint: commands are then position targets'
    )


def _add_demo(add: AddCommand) -> None:
    parser = add(
        'demo', 'sgp_ros.apps.demo:run_demo',
        'Identify a simulated reaction wheel live over DDS, then prove that a replay agrees.',
        'sgp demo --duration 20 --out out/demo',
    )  # fmt: skip
    parser.add_argument('--duration', type=_above(0.0), default=20.0, metavar='S',
                        help='duration [s] (default: %(default)s)')  # fmt: skip
    parser.add_argument('--seed', type=_seed, default=0, metavar='N', help='random seed')


def _add_simulate(add: AddCommand) -> None:
    parser = add(
        'simulate', 'sgp_ros.apps.simulation:run_simulation',
        'Simulate a robot, with effects to choose; write the recording and the true parameters.',
        f'sgp simulate arm.urdf --effect {example_effect("elbow", 0.3)} --sensor bits=14',
    )  # fmt: skip
    parser.add_argument('robot', metavar='ROBOT', help='built-in robot, robot YAML or model file')
    parser.add_argument('--duration', type=_above(0.0), default=20.0, metavar='S',
                        help='duration [s] (default: %(default)s)')  # fmt: skip
    parser.add_argument('--rate', type=_above(0.0), metavar='HZ', help='sampling rate [Hz]')
    parser.add_argument('--seed', type=_seed, default=0, metavar='N', help='random seed')
    parser.add_argument('--controller', metavar='NAME', help='controller that drives the robot')
    parser.add_argument(
        '--effect', dest='effects', action='append', default=[], metavar='NAME:joint=J,k=v',
        help='effect to add, see `sgp effects`; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--physical', action='append', default=[], metavar='NAME=VALUE',
        help='value of a physical parameter; may be repeated',
    )  # fmt: skip
    parser.add_argument(
        '--sensor', dest='sensors', action='append', default=[], metavar='NAME=VALUE',
        help='sensor property, such as bits=14, velocity=no or jitter=0.001; may be repeated',
    )  # fmt: skip
    parser.add_argument('--commands', metavar='BAG', help='replay the commands of BAG and compare')
    parser.add_argument('--nominal', metavar='ROBOT', help='second robot to compare with')
    _add_gains(parser, has_sim=False)


def _add_replay(add: AddCommand) -> None:
    parser = add(
        'replay', 'sgp_ros.apps.replay:run_replay',
        'Replay a recording through the online engine and report what it learned.',
        'sgp replay robot.mcap --robot linear_axis --out out/replay',
    )  # fmt: skip
    _add_recording(parser)
    parser.add_argument('--params', metavar='FILE', help="parameters or model (default: robot's)")
    parser.add_argument('--model', metavar='NPZ', help='continue from a saved model')
    parser.add_argument('--frozen', dest='is_learning', action='store_false',
                        help='predict and score without learning')  # fmt: skip
    parser.add_argument('--truth', metavar='JSON',
                        help='truth.json of a simulation, to compare parameters with')  # fmt: skip


def _add_identify(add: AddCommand) -> None:
    parser = add(
        'identify', 'sgp_ros.apps.identify:run_identify',
        'Identify a robot offline from a whole recording: parameters, URDF, simulated motion.',
        'sgp identify arm.mcap --robot arm.urdf --test other.mcap --out out/identify',
    )  # fmt: skip
    _add_recording(parser)
    parser.add_argument('--test', dest='tests', action='append', default=[], metavar='BAG',
                        help='held-out recording to score on; may be repeated')  # fmt: skip
    parser.add_argument('--holdout', choices=('tail', 'alternate'), default='tail',
                        help='part held out without --test (default: %(default)s)')  # fmt: skip
    parser.add_argument('--share', type=_above(0.0, 1.0), default=0.4, metavar='X',
                        help='fraction to hold out (default: %(default)s)')  # fmt: skip
    parser.add_argument('--stretch', type=_above(0.0), default=6.0, metavar='S',
                        help='length of the parts of --holdout alternate [s]')  # fmt: skip
    parser.add_argument('--cutoff', type=_above(0.0), metavar='HZ',
                        help='cut-off of the low-pass (default: from data)')  # fmt: skip
    parser.add_argument('--inputs', nargs='+', metavar='NAME',
                        help='inputs of the Gaussian process Z, such as own:velocity')  # fmt: skip
    _add_gains(parser, has_sim=False)


def _add_diagnose(add: AddCommand) -> None:
    parser = add(
        'diagnose', 'sgp_ros.apps.diagnose:run_diagnose',
        'Find the physics that the model lacks: which effect, at which joint, how large.',
        'sgp diagnose real.mcap --robot robot.urdf --test real_test.mcap --out out/diagnose',
    )  # fmt: skip
    _add_recording(parser, 'REAL', '; several recordings of one machine give one diagnosis')
    _add_gains(parser)
    parser.add_argument('--test', dest='tests', action='append', default=[], metavar='BAG',
                        help='held-out recording to validate on; may be repeated (default: '
                        'a quarter of REAL)')  # fmt: skip
    parser.add_argument('--static', action='store_true', help='REAL holds poses, not motion')
    parser.add_argument('--bodies', metavar='YAML',
                        help='mass, com and inertia of links without them in the model file '
                        '(default: estimated from REAL)')  # fmt: skip
    parser.add_argument('--rerun', action='store_true', help='also write finding.rrd for Rerun')


def _add_campaign(add: AddCommand) -> None:
    parser = add(
        'campaign', 'sgp_ros.apps.campaign:run_campaign',
        'Diagnose and identify many recordings; tabulate them and find trends and changes.',
        'sgp campaign bags --robot robot.urdf --covariates bags.csv --out out/campaign',
    )  # fmt: skip
    _add_recording(parser, 'PLACE', ", folder of them, or pattern such as 'bags/*/*.mcap'")
    parser.add_argument('--task', choices=('both', 'diagnose', 'identify'), default='both',
                        help='what to do with each recording (default: both)')  # fmt: skip
    _add_gains(parser)
    parser.add_argument('--covariates', metavar='CSV',
                        help='table with a column `recording` and optional robot, session and '
                        'time; all other numeric columns are covariates')  # fmt: skip
    parser.add_argument('--covariate-topic', dest='topics', action='append', default=[],
                        metavar='TOPIC', help='numeric topic, such as a temperature, whose mean '
                        'is a covariate; may be repeated')  # fmt: skip
    parser.add_argument('--scheduler', metavar='ADDRESS',
                        help='address of a Dask cluster, such as tcp://host:8786 (default: a '
                        'local one)')  # fmt: skip
    parser.add_argument('--workers', type=_count, metavar='N',
                        help='processes of a local cluster (default: one per core)'
                        )  # fmt: skip


def _add_import(add: AddCommand) -> None:
    parser = add(
        'import', 'sgp_ros.apps.importing:run_import',
        'Turn a table (CSV, NPZ, MAT, Parquet, HDF5, JSON, echoed YAML) into an MCAP recording.',
        'sgp import log.npz --robot arm.xml --out out/import',
    )  # fmt: skip
    parser.add_argument('table', metavar='FILE', help='.csv, .npz, .mat, .parquet, .h5, .json, '
                        '.jsonl, or .yaml of ros2 topic echo')  # fmt: skip
    parser.add_argument('--map', dest='map_path', metavar='YAML',
                        help='columns and units (default: guessed and written)')  # fmt: skip
    parser.add_argument('--robot', metavar='ROBOT', help='robot that the columns belong to')
    parser.add_argument('--group', metavar='NAME', help='which of several recordings in the file')
    parser.add_argument('--rate', type=_above(0.0), metavar='HZ', help='rate without times [Hz]')


def _add_check(add: AddCommand) -> None:
    parser = add(
        'check', 'sgp_ros.apps.check:run_check',
        'Check whether a recording is suitable for a diagnosis: clock, channels, motion, set-up.',
        'sgp check real.mcap --robot robot.urdf',
    )  # fmt: skip
    _add_recording(parser)
    _add_gains(parser, has_sim=False)


def _add_effects(add: AddCommand) -> None:
    parser = add(
        'effects', 'sgp_ros.apps.listings:run_effects',
        'List the effects that a robot can have besides rigid bodies: names, formulas, units.',
        'sgp effects --robot arm.yaml',
    )  # fmt: skip
    parser.add_argument('--robot', metavar='ROBOT',
                        help='also list the effects and laws of this robot')  # fmt: skip


def _add_export(add: AddCommand) -> None:
    parser = add(
        'export', 'sgp_ros.apps.export:run_export',
        'Export a robot for another program, and list what its format cannot express.',
        'sgp export out/diagnose/robot_diagnosed.yaml --to mjcf --out out/export',
    )  # fmt: skip
    parser.add_argument('robot', metavar='ROBOT', help='robot YAML or model file')
    parser.add_argument(
        '--to', required=True,
        choices=('mjcf', 'urdf', 'sdf', 'isaaclab', 'ros2_control', 'json'), help='format',
    )  # fmt: skip
    parser.add_argument('--model', metavar='MJCF',
                        help='MJCF to change (default: that of the robot)')  # fmt: skip
    parser.add_argument('--ranges', action='store_true',
                        help='also write value +- 2 std of each number')  # fmt: skip


def _add_robots(add: AddCommand) -> None:
    add('robots', 'sgp_ros.apps.listings:run_robots', 'List the built-in robots and their joints.',
        'sgp robots')  # fmt: skip


def _add_compile(add: AddCommand) -> None:
    add('compile', 'sgp_ros.apps.compiling:run_compile',
        'Compile the numerical code now, so that the first commands start faster.', 'sgp compile'
        )  # fmt: skip


def _add_watch(add: AddCommand) -> None:
    parser = add(
        'watch', 'sgp_ros.ros.watching:run_watch',
        'Show the state of a running node: joints, parameters, warnings, verdict.',
        'sgp watch --node /left/sgp_node',
    )  # fmt: skip
    parser.add_argument('--node', default='/sgp_node', metavar='NAME',
                        help='name of the node (default: %(default)s)')  # fmt: skip
    parser.add_argument('--wait', type=_above(0.0), default=10.0, metavar='S',
                        help='wait for its first message [s] (default: %(default)s)')  # fmt: skip
    parser.add_argument('--once', action='store_true', help='print the state once and exit')
    parser.add_argument('--layouts', metavar='DIR', help='write layouts for PlotJuggler, '
                        'Lichtblick and Foxglove into DIR')  # fmt: skip


GROUPS = {
    'Explore': {'demo': _add_demo, 'robots': _add_robots, 'effects': _add_effects,
                'compile': _add_compile},
    'Analyse a recording': {'import': _add_import, 'check': _add_check, 'diagnose': _add_diagnose,
                            'identify': _add_identify, 'replay': _add_replay},
    'Analyse many recordings': {'campaign': _add_campaign},
    'Work with a model': {'simulate': _add_simulate, 'export': _add_export},
    'Watch a running robot': {'watch': _add_watch},
}  # fmt: skip
"""Title of the help to its commands, each with the function that adds it; others come after."""
COMMANDS = {name: add_one for group in GROUPS.values() for name, add_one in group.items()}
EXAMPLE = f"""example without data of your own:
  sgp simulate double_pendulum --effect {example_effect('elbow', 0.05)} --out out/real
  sgp diagnose out/real/double_pendulum.mcap --robot double_pendulum"""
