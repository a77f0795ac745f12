"""`sgp diagnose` as its user sees it, on simulated robots with concealed effects."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgp_proof.concealed.promises import FACTOR, promised_and_delivered
from sgp_ros.cli import main
from sgp_ros.diagnosis.result import VERDICTS
from sgp_ros.engine.samples import JointSample, frozen_array
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.page import typeset
from sgp_ros.rigid.tree import read_urdf

ROOT = Path(__file__).parents[2]
PRACTICE = ROOT.parent / 'shared' / 'practice'
CASES = {
    '01': ('no_mismatch', ''),
    '05': ('missing_physics', 'Coulomb friction'),
    '33': ('parameters_only', 'mass of fore'),
}
"""Case to its verdict and what the sentence must name."""
LEAST_RATE_HZ = 100.0
BOTH = ('before', 'after')
ENTRY = {
    'joint', 'effect', 'parameters', 'location', 'log_bayes_factor', 'probability', 'share',
    'formula', 'why',
}  # fmt: skip

pytestmark = pytest.mark.skipif(not PRACTICE.exists(), reason='needs the practice cases')


def _case(number):
    return PRACTICE / 'cases' / f'case_{number}'


def _diagnose(bag, robot, out, *more):
    return main(['diagnose', str(bag), '--robot', str(robot), '--out', str(out), *more])


@pytest.fixture(scope='module')
def folders(tmp_path_factory):
    """Results and standard output of each case."""
    return {}, tmp_path_factory.mktemp('diagnose')


@pytest.fixture(
    params=[pytest.param(x, marks=pytest.mark.long) if x != '05' else x for x in CASES]
)
def finished(request, folders, capsys):
    """Number, folder of the results and what was printed."""
    done, folder = folders
    number = request.param
    if number not in done:
        case, out = _case(number), folder / number
        tests = [
            x for stem in ('real_test', 'real_far') for x in ('--test', case / f'{stem}.mcap')
        ]
        status = _diagnose(
            case / 'real.mcap', case / 'robot.urdf', out, '--sim', str(case / 'sim.mcap'),
            '--json', *map(str, tests),
        )  # fmt: skip
        assert status == 0
        captured = capsys.readouterr()
        done[number] = captured.err + captured.out
    return number, folder / number, done[number]


def test_the_verdict_and_what_is_named_are_true(finished):
    """In the file, in the first line of the terminal and at the top of the page."""
    number, out, printed = finished
    verdict, named = CASES[number]
    assert json.loads((out / 'diagnosis.json').read_text())['verdict'] == verdict
    sentence = printed.splitlines()[0]
    assert named in sentence
    assert typeset(sentence) in (out / 'report.html').read_text()
    assert str(out / 'report.html') in printed


def test_the_file_is_complete_and_agrees_with_the_last_line(finished):
    """Every field of the schema, for every joint and recording."""
    number, out, printed = finished
    content = json.loads((out / 'diagnosis.json').read_text())
    assert json.loads(printed.splitlines()[-1]) == content
    assert content['schema'] == 2
    assert content['verdict'] in VERDICTS
    assert 0.0 <= content['certainty'] <= 1.0
    assert content['reference'] == 'simulation'
    for entry in (*content['findings'], *content['alternatives']):
        assert entry.keys() - {'in_simulation', 'difference'} == ENTRY
        assert entry['location'].keys() == {'variables', 'intervals', 'time'}
    joints = set(read_urdf(_case(number) / 'robot.urdf').moving_names)
    assert content['fit']['target'] == 'torque'
    for stem in ('train', 'real_test', 'real_far'):
        for key in ('nmse_before', 'nmse_after'):
            assert content['fit'][stem][key].keys() == joints
    assert {v['joint'] for v in content['visibility']} == joints
    for path in content['fit']['predictions'].values():
        assert (out / path).exists()


def test_predictions_have_a_column_for_each_joint_and_come_often_enough(finished):
    """Header and rate as the schema asks, times rising within the recording."""
    number, out, _ = finished
    joints = read_urdf(_case(number) / 'robot.urdf').moving_names
    for stem in ('real_test', 'real_far'):
        with (out / f'pred_{stem}.csv').open() as file:
            rows = list(csv.reader(file))
        assert rows[0] == ['t', *(f'ddq_{name}' for name in joints)]
        numbers = np.array(rows[1:], dtype=float)
        assert np.isfinite(numbers).all()
        steps = np.diff(numbers[:, 0])
        assert (steps > 0.0).all()
        assert np.median(1.0 / steps) >= LEAST_RATE_HZ
        assert numbers[0, 0] >= 0.0


@pytest.mark.long
def test_a_replay_of_the_diagnosed_robot_delivers_what_was_promised(finished):
    """Within a factor of two, joint by joint, in windows that the stream chose."""
    number, out, _ = finished
    found = promised_and_delivered(_case(number) / 'real.mcap', out)
    assert found['left_out'] == []
    for joint, x in found['effort_nmse'].items():
        assert x['promised'] == x['diagnosed']
        assert x['delivered'] < FACTOR * x['promised'], joint


def test_no_half_written_file_is_left(finished):
    """Pictures, numbers, page, and the diagnosed robot with its URDF."""
    _, out, _ = finished
    suffixes = {path.suffix for path in out.iterdir()}
    shown = {'.html', '.png', '.svg', '.mcap', '.xml'}  # page, pictures, a recording with layout
    assert suffixes == {'.json', '.csv', '.npz', '.yaml', '.urdf'} | shown


@pytest.fixture(scope='module')
def arm_events():
    """Everything in the recording of an arm of two joints."""
    return list(open_recording(str(_case('05') / 'real.mcap')).events(None, None))


def _write(path, events):
    with RecordingWriter(path) as writer:
        for event in events:
            writer.write_event(event)
    return path


def _held_still(event):
    if not isinstance(event, JointSample):
        return event
    return replace(event, position=frozen_array([0.3, 0.2]), velocity=frozen_array([0.0, 0.0]))


@pytest.mark.parametrize(
    ('change', 'said'),
    [
        (lambda events: events[:40], 'use a longer recording'),
        (lambda events: [_held_still(e) for e in events], 'no joint of planar_2r moves'),
        (lambda events: [], 'contains no messages'),
        (lambda events: [e for e in events if isinstance(e, JointSample)], 'effort'),
    ],
    ids=['too short', 'motionless', 'empty', 'no commands'],
)
def test_a_recording_that_tells_nothing_ends_in_one_line(
    arm_events, tmp_path, capsys, change, said
):
    """With status 2, what was found and what to do; and nothing is written."""
    bag = _write(tmp_path / 'bag.mcap', change(arm_events))
    assert _diagnose(bag, _case('05') / 'robot.urdf', tmp_path / 'out') == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert '\n' not in error
    assert not list((tmp_path).rglob('.sgp_growing_*'))
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('bag', 'robot', 'more', 'said'),
    [
        ('case_05/real.mcap', 'case_01/robot.urdf', (), 'expected states of the joints'),
        (
            'case_05/real.mcap',
            ROOT / 'config' / 'robots' / 'panda.yaml',
            (),
            'states of the joints',
        ),
        (
            'case_05/real.mcap',
            'case_05/robot.urdf',
            ('--sim', _case('01') / 'sim.mcap'),
            "sim.mcap contains the joints ['hinge']",
        ),
        (
            'case_05/real.mcap',
            'case_05/robot.urdf',
            ('--test', _case('01') / 'real_test.mcap'),
            "real_test.mcap contains the joints ['hinge']",
        ),
        ('nowhere.mcap', 'case_05/robot.urdf', (), 'no recording at'),
        ('case_05/real.mcap', 'nowhere.urdf', (), 'neither a built-in robot nor a file'),
        ('case_05/real.mcap', 'case_05/robot.urdf', ('--sim', 'nowhere.mcap'), 'nowhere.mcap'),
        ('case_05/real.mcap', 'case_05/robot.urdf', ('--test', 'nowhere.mcap'), 'nowhere.mcap'),
        ('case_05/real.mcap', 'case_05/robot.urdf', ('--joint-states', '/no'), 'no topic /no'),
    ],
)
def test_bad_arguments_end_in_one_line(tmp_path, capsys, bag, robot, more, said):
    """Another robot, one of other joints, missing files."""
    named = PRACTICE / 'cases' / robot
    assert _diagnose(PRACTICE / 'cases' / bag, named, tmp_path / 'out', *map(str, more)) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert '\n' not in error


@pytest.mark.long
def test_without_a_test_a_part_is_held_out_and_a_wrong_simulation_is_reported(tmp_path, capsys):
    """An entry of its own in the file, intervals, roll-outs, and remarks with numbers."""
    case, out = _case('05'), tmp_path / 'out'
    sim = ('--sim', str(case / 'real_far.mcap'))
    assert _diagnose(case / 'real.mcap', case / 'robot.urdf', out, *sim) == 0
    printed = capsys.readouterr().out
    content = json.loads((out / 'diagnosis.json').read_text())
    fit = content['fit']
    assert set(fit) == {'target', 'train', 'held_out', 'predictions'}
    assert fit['predictions'] == {}
    for name in ('nmse', 'acceleration_nmse', 'rollout_nmse'):
        before, after = (fit['held_out'][f'{name}_{when}']['elbow'] for when in BOTH)
        assert after < 0.01 * before
        low, high = fit['held_out'][f'{name}_after_interval']['elbow']
        assert low < after < high
    assert fit['held_out']['rollouts']['failed'] == 0
    share = content['simulation']['elbow']
    remarks = ' '.join(content['settings']['remarks'])
    assert f'{100.0 * share:.2g} % of the mean squared effort of elbow' in remarks
    assert 'was held out (8.25 of 33 s)' in remarks
    assert all(line in printed for line in content['settings']['remarks'])
