"""Diagnoses of all recordings of real machines, judged by what an expert expects of them.

    python -m sgp_proof.real.diagnosis [NAME ...]

Each machine is a list of commands as a user would give them, run in one folder in which `data` and
`config` stand for the recordings and the configuration of this repository. `expected` says how a
diagnosis is judged; misses stay in the table.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from sgp_proof.real.expected import judge, read_expected
from sgp_proof.real.recordings import DATA, DOUBLE, SIMPLE, UNDISTURBED_S
from sgp_proof.real.recordings import main as withheld
from sgp_proof.result_files import ROOT, make_parser, read_result, write_result
from sgp_ros.cli import BAD_INPUT
from sgp_ros.cli import main as sgp
from sgp_ros.report.metrics import versions

IMAGES = ROOT / 'docs' / 'images' / 'real_machines'
SHOWN_RIVALS = 4


_REAL, _TX40 = 'python -m sgp_proof.real.recordings', 'data/staubli_tx40/tx40_joint'


def _imported(name: str, *files: str) -> tuple[str, ...]:
    return tuple(f'sgp import {f} --map config/import/{name}.yaml --out out' for f in files)


def _pendulum(name: str) -> tuple[str, ...]:
    cut = f'python -m sgp_proof.real.recordings cut out/{name}.csv data/{SIMPLE.format(name)}'
    return (
        f'{cut} --to {UNDISTURBED_S[name]:g}',
        *_imported('dfki_simple_pendulum', f'out/{name}.csv'),
    )


def _double(design: str, robot: str, learn: str, test: str) -> tuple[str, ...]:
    """Join runs of a design of the double pendulum to one recording, and others to the test."""
    runs = {part: ' '.join('data/' + DOUBLE.format(design, i) for i in which.split())
            for part, which in (('learn', learn), ('test', test))}  # fmt: skip
    return (
        *(f'python -m sgp_proof.real.recordings join out/{p}.npz {x}' for p, x in runs.items()),
        *_imported('dfki_double_pendulum', 'out/learn.npz', 'out/test.npz'),
        (
            f'sgp diagnose out/learn.mcap --robot config/robots/{robot}.urdf'
            ' --test out/test.mcap --out out/diagnosis'
        ),
    )


def _arm(name: str, recording: str, robot: str, split: float) -> tuple[str, ...]:
    """Identify the bodies with friction in the model, then take the friction out of the URDF."""
    source, identified = f'data/{name}/{recording}.npz', 'out/identified/robot_identified.urdf'
    diagnose = f'sgp diagnose out/learn.mcap --robot out/{robot}.yaml --test out/test.mcap'
    return (
        f'python -m sgp_proof.real.recordings cut out/learn.npz {source} --to {split:g}',
        f'python -m sgp_proof.real.recordings cut out/test.npz {source} --from {split:g}',
        *_imported(name, 'out/learn.npz', 'out/test.npz'),
        f'sgp identify out/learn.mcap --robot config/robots/{robot}.yaml --out out/identified',
        f'python -m sgp_proof.real.recordings friction out/{robot}.urdf {identified}',
        f'cp config/robots/{robot}.yaml out',
        f'{diagnose} --out out/diagnosis',
    )


MACHINES = {
    'emps': (
        *_imported('emps', 'data/emps/emps_id.csv', 'data/emps/emps_val_pulses.csv'),
        (
            'sgp diagnose out/emps_id.mcap --robot config/robots/emps.urdf'
            ' --test out/emps_val_pulses.mcap --out out/diagnosis'
        ),
    ),
    'simple_pendulum_1kg': (
        *_pendulum('energy_shaping_1kg'),
        (
            'sgp diagnose out/energy_shaping_1kg.mcap --robot config/robots/simple_pendulum.urdf'
            ' --out out/diagnosis'
        ),
    ),
    'simple_pendulum': (
        *_pendulum('energy_shaping'),
        *_pendulum('sac'),
        (
            'sgp diagnose out/energy_shaping.mcap --robot config/robots/simple_pendulum.urdf'
            ' --test out/sac.mcap --out out/diagnosis'
        ),
    ),
    'double_pendulum': _double(
        'A.0__20220815', 'double_pendulum_a0', '00 02 04 11 13', '01 03 05 12'
    ),
    'double_pendulum_c0': _double(
        'C.0__20220914', 'double_pendulum_c0', '00 02 04 06 12', '01 03 05 13'
    ),
    'panda': _arm('panda', 'panda_exciting', 'panda', 12.6),
    'tiago': _arm('tiago', 'tiago_dynamic', 'tiago_arm', 48.0),
    'staubli_tx40': (
        *_imported('tx40', *(f'{_TX40}_{part}.npz' for part in ('train', 'test'))),
        (
            'sgp diagnose out/tx40_joint_train.mcap'
            ' --robot data/staubli_tx40/tx40_mdh_modified.urdf'
            ' --test out/tx40_joint_test.mcap --out out/diagnosis'
        ),
    ),
    'tflex': (
        *(f'{_REAL} cut out/{part}.npz data/tflex/tflex_random.npz {span}'
          for part, span in (('learn', '--to 78'), ('test', '--from 78'))),
        *_imported('tflex', 'out/learn.npz', 'out/test.npz'),
        (
            'sgp diagnose out/learn.mcap --robot config/robots/revolute_axis.urdf'
            ' --test out/test.mcap --out out/diagnosis'
        ),
    ),
    'laas_settled': (
        *_imported('laas_settled', 'data/laas_cogging/settled_points.npz'),
        (
            'sgp diagnose out/settled_points.mcap --static'
            ' --robot config/robots/revolute_axis.urdf --out out/diagnosis'
        ),
    ),
    'laas_speed': (
        (
            'python -m sgp_proof.real.recordings cut out/constant_speed.npz'
            ' data/laas_cogging/constant_speed.npz --to 15'
        ),
        *_imported('laas_speed', 'out/constant_speed.npz'),
        (
            'sgp diagnose out/constant_speed.mcap --robot config/robots/revolute_axis.urdf'
            ' --out out/diagnosis'
        ),
    ),
}  # fmt: skip
"""Commands from the authors' files to the diagnosis, which is the last one."""


_EMPS = 'sgp diagnose out/emps_id.mcap --test out/emps_val_pulses.mcap --robot'
STEPS = {
    'emps': (
        f'{_EMPS} config/robots/emps_viscous.yaml --out out/viscous',
        f'{_EMPS} config/robots/emps_symmetric.yaml --out out/symmetric',
        f'{_EMPS} out/diagnosis/robot_diagnosed.yaml --out out/again',
    ),
}
"""Further diagnoses of a machine, of models that lack less."""


class RefusedError(Exception):
    """A command that ended with a complaint."""


def execute(command: str, folder: Path) -> str:
    """Run one command line in a folder and return what it printed."""
    program, *words = command.split()
    if program == 'cp':
        shutil.copy(folder / words[0], folder / words[1])
        return ''
    if program == 'python':
        withheld(words[2:])
        return ''
    printed, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(complained):
        status = sgp(words)
    if status not in {0, BAD_INPUT}:
        raise SystemExit(f'{command}: status {status}')
    if status:
        raise RefusedError(complained.getvalue().strip() or f'{command}: status {status}')
    return printed.getvalue()


def take_pictures(report: Path, target: Path) -> list[str]:
    """Replace what the target holds by all figures of a report and return their names."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    pictures = sorted(report.glob('*.png'))
    for picture in pictures:
        shutil.copy(picture, target)
    return [picture.stem for picture in pictures]


@contextlib.contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Work in a folder with recordings, configuration and room for what comes out."""
    (folder / 'data').symlink_to(DATA)
    (folder / 'config').symlink_to(ROOT / 'config')
    (folder / 'out').mkdir()
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def run(name: str, folder: Path, images: Path) -> dict:
    """Carry out the commands of a machine and return what its diagnosis says."""
    seconds, expected = {}, read_expected()[name]
    begin = {'commands': MACHINES[name], 'source': expected['source'], 'revision': ''}
    with inside(folder):
        try:
            for command in MACHINES[name]:
                began = time.perf_counter()
                printed = execute(command, folder)
                if command.startswith(('sgp identify', 'sgp diagnose')):
                    seconds[command.split()[1]] = round(time.perf_counter() - began, 1)
        except RefusedError as refusal:
            found = {'sentence': str(refusal), 'pictures': [], 'verdict': 'refused'}
            return begin | found | {'judged': judge(expected, {'refused': str(refusal)})}
        steps = [step(command, folder) for command in STEPS.get(name, ())]
    out = folder / 'out' / 'diagnosis'
    found = read(out, printed)
    return {
        **begin,
        'pictures': take_pictures(out, images / name),
        **found,
        'judged': judge(expected, found),
        'seconds': seconds,
        'steps': steps,
    }


def step(command: str, folder: Path) -> dict:
    """Carry out a further diagnosis and return what it says."""
    printed = execute(command, folder)
    return {'command': command, **read(folder / command.rsplit(maxsplit=1)[-1], printed)}


def read(out: Path, printed: str) -> dict:
    """Return what a diagnosis wrote and its sentence, without what no page shows."""
    found = json.loads((out / 'diagnosis.json').read_text(encoding='utf-8'))
    kept = (
        'verdict', 'certainty', 'findings', 'equivalents', 'parameter_errors', 'dependence',
        'settings', 'visibility',
    )  # fmt: skip
    return {
        'sentence': printed.splitlines()[0],
        **{key: found[key] for key in kept},
        'alternatives': found['alternatives'][:SHOWN_RIVALS],
        'fit': {k: v for k, v in found['fit'].items() if k != 'predictions'},
    }


def main() -> None:
    """Run the named machines, or all, beside results that are there."""
    parser = make_parser(__doc__, 'real_diagnosis', MACHINES)
    parser.add_argument('--images', type=Path, default=IMAGES, help='folder of the pictures')
    arguments = parser.parse_args()
    machines = read_result(arguments.out).get('machines', {})
    for name in arguments.names:
        with tempfile.TemporaryDirectory() as folder:
            machines[name] = run(name, Path(folder), arguments.images)
        result = {
            'command': 'python -m sgp_proof.real.diagnosis',
            'versions': versions(),
            'machines': {key: machines[key] for key in MACHINES if key in machines},
        }
        write_result(arguments.out, result)
        judged = machines[name]['judged']
        print(f'{name}: {judged["grade"]}. {machines[name]["sentence"]}')
        print(*(f'    {reason}' for reason in judged['reasons']), sep='\n', flush=True)


if __name__ == '__main__':
    main()
