"""With a simulation as the reference, what differs from it is found, in either direction."""

import json
from pathlib import Path

import pytest

from sgp_ros.cli import main

CASES = Path(__file__).parents[3] / 'shared' / 'practice2' / 'cases'
ANSWERS = CASES.parent / 'answers'

pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason='shared recordings are elsewhere')


@pytest.mark.parametrize(
    'case', ['case_05', *(pytest.param(c, marks=pytest.mark.long) for c in ('case_06', 'case_07'))]
)
def test_the_machine_is_compared_with_its_simulation(case, tmp_path, capsys):
    folder = CASES / case
    words = ['diagnose', str(folder / 'real.mcap'), '--sim', str(folder / 'sim.mcap'), '--robot',
             str(folder / 'robot.urdf'), '--test', str(folder / 'real_test.mcap'),
             '--out', str(tmp_path)]  # fmt: skip
    assert main(words) == 0
    found = json.loads((tmp_path / 'diagnosis.json').read_text())
    answer = json.loads((ANSWERS / f'{case}.json').read_text())
    assert found['reference'] == 'simulation'
    assert found['verdict'] == answer['verdict']
    printed = capsys.readouterr().out
    assert len(found['findings']) == len(answer['findings'])
    for right, said in zip(answer['findings'], found['findings'], strict=True):
        assert (said['joint'], said['effect']) == (right['joint'], right['effect'])
        for side in ('parameters', 'in_simulation', 'difference'):
            for name, true in right[side].items():
                number = said[side][name]
                assert abs(number['value'] - true) < 3.0 * number['std'] + 0.002
        assert 'in the simulation level' in printed
    if not answer['findings']:
        shared = {(f['joint'], f['effect']) for f in found['shared']}
        assert {(j, 'coulomb_friction') for j in ('waist', 'shoulder', 'elbow')} <= shared
        assert 'No mismatch' in printed
