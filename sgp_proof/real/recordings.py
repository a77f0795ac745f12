"""Recordings of real machines: the files of their authors, robots, maps and what is withheld.

python -m sgp_proof.real.recordings cut OUT TABLE --from S --to S
python -m sgp_proof.real.recordings join OUT NPZ [NPZ ...]
python -m sgp_proof.real.recordings friction OUT URDF

The last ones write a part of a table, several tables as one, and a URDF without friction.
"""

from __future__ import annotations

import argparse
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgp_proof.result_files import ROOT
from sgp_ros.cli import main as sgp
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.robot import Robot

DATA = ROOT.parent / 'shared' / 'data'
"""The files of the authors, which are not part of this repository."""
ROBOTS = ROOT / 'config' / 'robots'
PAUSE_S = 1.0
DOUBLE = 'dfki_double_pendulum/design_{}__sys_id__trajectory_{}.npz'
SIMPLE = 'dfki_simple_pendulum/{}.csv'
UNDISTURBED_S = {'energy_shaping': 3.9, 'sac': 3.9, 'energy_shaping_1kg': 7.0}
"""Seconds before hands or a balancing controller act on the simple pendulum."""


@dataclass(frozen=True)
class Machine:
    """A recording with its robot and settings.

    Attributes:
        file: below `DATA`: a bag, or a table with a map.
        robot: built-in name, or YAML below the repository.
        config: stem of the parameter file.
        mapping: stem of the map for import; empty for a bag.
        speed: in multiples of the recorded rate, where the recording is played.
        seconds: from the beginning that count; None for all.
    """

    file: str
    robot: str
    config: str
    mapping: str = ''
    speed: float = 1.0
    seconds: float | None = None

    @property
    def robot_argument(self) -> str:
        """The robot as `--robot` takes it."""
        return str(ROOT / self.robot) if self.robot.endswith('.yaml') else self.robot

    @property
    def params(self) -> Path:
        """The parameter file."""
        return ROOT / 'config' / f'{self.config}.yaml'

    def load_robot(self) -> Robot:
        """Return the robot."""
        return load_robot(self.robot_argument)

    def bag(self, folder: Path) -> Path:
        """Return the recording as a bag, imported into a folder where it is a table."""
        if not self.mapping:
            return DATA / self.file
        bag = imported(self.file, self.mapping, folder)
        return bag if self.seconds is None else cut_bag(bag, self.seconds)


MACHINES = {
    'emps': Machine('emps/emps_id.csv', 'linear_axis', 'linear_axis', 'emps'),
    'panda': Machine('panda/panda_exciting.npz', 'config/robots/panda.yaml', 'panda', 'panda'),
    # Its first half only gathers; four times as fast, all of it fits into the stretch.
    'tiago': Machine(
        'tiago/mcap_tiago_dynamic', 'config/robots/tiago_arm.yaml', 'tiago_arm', speed=4.0
    ),
    'double_pendulum_a0': Machine(
        DOUBLE.format('A.0__20220815', '00'), 'double_pendulum', 'double_pendulum',
        'dfki_double_pendulum',
    ),
    'double_pendulum_c0': Machine(
        DOUBLE.format('C.0__20220914', '00'), 'double_pendulum', 'double_pendulum',
        'dfki_double_pendulum',
    ),
    'simple_pendulum': Machine(
        SIMPLE.format('energy_shaping'), 'simple_pendulum', 'simple_pendulum',
        'dfki_simple_pendulum', seconds=UNDISTURBED_S['energy_shaping'],
    ),
    'simple_pendulum_1kg': Machine(
        SIMPLE.format('energy_shaping_1kg'), 'simple_pendulum', 'simple_pendulum',
        'dfki_simple_pendulum', seconds=UNDISTURBED_S['energy_shaping_1kg'],
    ),
}  # fmt: skip


def imported(file: str, mapping: str, folder: Path) -> Path:
    """Return a table below `DATA` as a bag."""
    path = ROOT / 'config' / 'import' / f'{mapping}.yaml'
    if sgp(['import', str(DATA / file), '--map', str(path), '--out', str(folder)]):
        raise SystemExit(f'{file} cannot be imported')
    return folder / f'{Path(file).stem}.mcap'


def cut_bag(bag: Path, seconds: float) -> Path:
    """Return a bag of the first seconds of another one."""
    events = list(open_recording(bag).events())
    target = bag.with_name(f'{bag.stem}_{seconds:g}s.mcap')
    with RecordingWriter(target) as writer:
        for event in events:
            if event.stamp_ns - events[0].stamp_ns <= 1e9 * seconds:
                writer.write_event(event)
    return target


def cut(source: Path, target: Path, start: float, stop: float) -> None:
    """Write the rows of a table (CSV or NPZ) whose time is in [start, stop) [s].

    Time is the first column of a CSV and the array `t` of an NPZ.
    """
    if source.suffix == '.csv':
        with source.open(encoding='utf-8', newline='') as file:
            header, *rows = csv.reader(file)
        with target.open('w', encoding='utf-8', newline='') as file:
            kept = (row for row in rows if start <= float(row[0]) < stop)
            csv.writer(file).writerows([header, *kept])
        return
    with np.load(source, allow_pickle=False) as table:
        arrays = dict(table)
    inside = (arrays['t'] >= start) & (arrays['t'] < stop)
    np.savez(target, **{k: x[inside] if len(x) == len(inside) else x for k, x in arrays.items()})


def join(sources: list[Path], target: Path) -> None:
    """Write several NPZ recordings as one, a second of pause between them."""
    tables = [dict(np.load(source, allow_pickle=False)) for source in sources]
    begin = 0.0
    for table in tables:
        table['t'] = table['t'] - table['t'][0] + begin
        begin = table['t'][-1] + PAUSE_S
    np.savez(target, **{k: np.concatenate([table[k] for table in tables]) for k in tables[0]})


def without_friction(urdf: str) -> str:
    """Return a URDF without the `<dynamics>` of its joints, that is damping and friction."""
    return re.sub(r'\s*<dynamics\b[^>]*/>', '', urdf)


def main(argv: Sequence[str] | None = None) -> None:
    """Run one of the three commands; `argv` are its words, those of the process without."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('command', choices=('cut', 'join', 'friction'))
    parser.add_argument('target', type=Path)
    parser.add_argument('sources', type=Path, nargs='+')
    parser.add_argument('--from', dest='start', type=float, default=0.0)
    parser.add_argument('--to', dest='stop', type=float, default=np.inf)
    arguments = parser.parse_args(argv)
    first = arguments.sources[0]
    if arguments.command == 'cut':
        cut(first, arguments.target, arguments.start, arguments.stop)
    elif arguments.command == 'join':
        join(arguments.sources, arguments.target)
    else:
        text = without_friction(first.read_text(encoding='utf-8'))
        arguments.target.write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
