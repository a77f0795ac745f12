"""Diagnoses of the double pendulum with other low-passes, runs and nominal models.

    python -m sgp_proof.real.double_pendulum_low_pass

Other low-passes than the recording chose, more runs, other runs, and a model that lacks Coulomb
friction alone. The low-pass is no option of the command, so it is set in its place here.
"""

from __future__ import annotations

import contextlib
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import savgol_filter

from sgp_proof.real.diagnosis import execute, inside, read
from sgp_proof.real.recordings import DATA, DOUBLE
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.diagnosis import connected
from sgp_ros.report.metrics import versions

DAY = 'A.0__20220815'
MAP = 'config/import/dfki_double_pendulum.yaml'
LEARNED, HELD = ('00', '02', '04', '11', '13'), ('01', '03', '05', '12')
ROBOT, WITH_ROTORS = 'double_pendulum_a0.urdf', 'double_pendulum_a0_rotors.yaml'
EVERY = (*LEARNED, *HELD)
VARIANTS = (
    *((LEARNED, ROBOT, cutoff) for cutoff in (8.0, 5.0, None, 2.5, 1.8, 1.3)),
    (HELD, ROBOT, None),
    *((EVERY, ROBOT, cutoff) for cutoff in (None, 2.5, 1.8, 1.3)),
    *((LEARNED, WITH_ROTORS, cutoff) for cutoff in (None, 1.8)),
)
"""Runs, nominal robot, low-pass [Hz]; None for the one that the recording chooses."""
_WINDOW, _ORDER = 51, 3


@contextlib.contextmanager
def low_pass(cutoff):
    """Set the low-pass of diagnoses [Hz]; None leaves the choice to the recording."""
    choose = connected.choose_bandwidth

    def fixed(raw, tree):
        return replace(choose(raw, tree), cutoff=cutoff, state_cutoff=2.5 * cutoff)

    connected.choose_bandwidth = choose if cutoff is None else fixed
    try:
        yield
    finally:
        connected.choose_bandwidth = choose


def diagnosed(runs, robot, cutoff):
    """Return what a diagnosis says that learns from some runs.

    A recording is named for the test, or a part of these runs would be held back for it.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with inside(folder), low_pass(cutoff):
            for part, chosen in (('learn', runs), ('test', HELD[:1])):
                sources = ' '.join(f'data/{DOUBLE.format(DAY, run)}' for run in chosen)
                execute(
                    f'python -m sgp_proof.real.recordings join out/{part}.npz {sources}', folder
                )
                execute(f'sgp import out/{part}.npz --map {MAP} --out out', folder)
            printed = execute(
                f'sgp diagnose out/learn.mcap --robot config/robots/{robot} '
                '--test out/test.mcap --out out/diagnosis',
                folder,
            )
        found = read(folder / 'out' / 'diagnosis', printed)
    kept = ('verdict', 'certainty', 'settings', 'sentence', 'alternatives')
    given = {'runs': runs, 'robot': robot, 'cutoff_hz': cutoff}
    return given | {key: found[key] for key in kept}


def noise():
    """Return the noise of position [rad] and velocity [rad/s], median of runs and joints.

    It is what a cubic polynomial of 51 samples, a tenth of a second, leaves.
    """
    rough = {'q': [], 'dq': []}
    for run in EVERY:
        table = np.load(DATA / DOUBLE.format(DAY, run), allow_pickle=False)
        for name, values in rough.items():
            smooth = savgol_filter(table[name], _WINDOW, _ORDER, axis=0)
            values.extend((table[name] - smooth).std(axis=0))
    return {name: float(np.median(values)) for name, values in rough.items()}


def main():
    """Carry out all variants and write what they say."""
    parser = make_parser(__doc__, 'double_pendulum_diagnosis')
    parser.add_argument('--variants', type=int, default=len(VARIANTS), help='how many of them')
    arguments = parser.parse_args()
    result = {
        'command': 'python -m sgp_proof.real.double_pendulum_low_pass',
        'versions': versions(),
        'noise': noise(),
        'variants': [],
    }
    for variant in VARIANTS[: arguments.variants]:
        found = diagnosed(*variant)
        result['variants'].append(found)
        print(*variant[1:], found['sentence'])
    write_result(arguments.out, result)


if __name__ == '__main__':
    main()
