"""`sgp identify` from a recording to files, and one line for what cannot be identified."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.apps.held_rollouts import stretches_of
from sgp_ros.apps.identify import IdentifyOptions, names_of_tests, read_signals
from sgp_ros.batch.identification import HELD_OUT, IdentificationOptions, identify
from sgp_ros.cli import main
from sgp_ros.engine.samples import POSITION, CommandSample, JointSample, frozen_array
from sgp_ros.physics.term import Motion
from sgp_ros.recordings.messages import JOINT_STATE
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_robot
from test.batch.arm_world import (
    COULOMB,
    VISCOUS,
    arm_samples,
    passive_samples,
    write_arm,
    write_bag,
)
from test.report.pages import content_of

SAMPLES = arm_samples(rate=50.0)
KP, KD, STEP_NS = 40.0, 3.0, 5_000_000
STILL = frozen_array([0.2, 0.3])
FILES = {
    'identification.json', 'robot_identified.yaml', 'robot_identified.urdf', 'report.html',
    'filter.png', 'filter.svg', 'prediction_held_out.png', 'prediction_held_out.svg',
}  # fmt: skip


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Where the arm's recording and robot file lie."""
    folder = tmp_path_factory.mktemp('arm')
    write_arm(folder)
    write_bag(folder / 'arm.mcap', SAMPLES)
    return folder


@pytest.fixture(scope='module')
def identified(folder):
    """Findings and results of the whole command."""
    out = folder / 'out'
    assert main(_command(folder / 'arm.mcap', folder / 'arm.yaml', out)) == 0
    return json.loads((out / 'identification.json').read_text()), out


def _command(bag, robot, out, *options):
    return [str(x) for x in ('identify', bag, '--robot', robot, '--out', out, *options)]


def _motion(robot, n=40):
    rng = np.random.default_rng(5)
    q, v, a = rng.normal(size=(3, n, len(robot.joints)))
    return Motion(q, v, a, np.zeros_like(q))


def _efforts(robot, motion):
    return robot.regressor(motion) @ np.array([c.prior_mean for c in robot.coefficients])


def test_the_command_writes_complete_results_and_nothing_else(identified):
    findings, out = identified
    assert {path.name for path in out.glob('[!.]*')} == FILES
    assert findings['schema'] == 1
    assert findings['recording'] == 'arm.mcap'


def test_friction_that_was_planted_lies_in_the_printed_intervals(identified):
    """Four standard deviations, from a recording that went through a file."""
    findings, _ = identified
    found = {p['name']: p for p in findings['parameters']}
    for j, joint in enumerate(('turn', 'lift')):
        for kind, truth in (('viscous', VISCOUS[j]), ('coulomb', COULOMB[j])):
            p = found[f'{joint}.{kind}']
            assert abs(p['value'] - truth) < 4.0 * p['std'], p


def test_what_no_torque_tells_has_no_interval(identified):
    """The mass of the column turns about its own axis."""
    findings, _ = identified
    mass = next(p for p in findings['parameters'] if p['name'] == 'column.mass')
    assert mass['std'] is None
    assert mass['status'] == 'structural'


def test_the_page_says_what_the_numbers_say(identified):
    """And fetches nothing from elsewhere."""
    findings, out = identified
    page = (out / 'report.html').read_text()
    assert f'{findings["scores"]["SGP"][HELD_OUT]["mean_nmse"]:.2g}' in page
    content_of(page)


def test_the_identified_robot_file_predicts_the_identified_efforts(identified):
    """Loaded again, with the values of real bodies as its prior."""
    findings, out = identified
    robot = load_robot(str(out / 'robot_identified.yaml'))
    prior = {c.name: c.prior_mean for c in robot.coefficients}
    assert prior == {p['name']: p['consistent'] for p in findings['parameters']}


def test_the_identified_urdf_predicts_the_same_efforts_as_the_robot_file(identified):
    """But for offsets, which a URDF cannot hold."""
    _, out = identified
    robot = load_robot(str(out / 'robot_identified.yaml'))
    urdf = nominal_robot(load_robot(str(out / 'robot_identified.urdf')))
    motion = _motion(robot)
    offsets = [c.prior_mean for c in robot.coefficients if c.name.endswith('.offset')]
    expected = _efforts(robot, motion) - offsets
    np.testing.assert_allclose(_efforts(urdf, motion), expected, atol=1e-6)


def test_what_was_identified_is_the_prior_of_the_next_run(identified, folder, tmp_path):
    _, out = identified
    command = _command(folder / 'arm.mcap', out / 'robot_identified.yaml', tmp_path / 'again')
    assert main(command) == 0


def test_roll_outs_of_the_identified_arm_follow_what_was_held_out(identified):
    """A thousandth of the error of standing still. The longest one passes near the upright pose,
    where the side to which the arm falls hangs on the last digit: it need only stay finite.
    """
    findings, _ = identified
    scores = findings['rollouts'][HELD_OUT]
    assert [round(s['horizon_s'], 2) for s in scores[:2]] == [0.02, 0.3]
    assert all(score['diverged'] == 0 for score in scores)
    for score in scores[:2]:
        assert all(joint['nmse_path'] < 1e-3 for joint in score['joints'].values()), score


@pytest.mark.parametrize('holdout', ['tail', 'alternate'])
def test_roll_outs_run_over_held_out_stretches_only(folder, holdout):
    """No row that was learned from lies inside one, and each is a stretch of the recording."""
    robot = load_robot(str(folder / 'arm.yaml'))
    signals = read_signals(str(folder / 'arm.mcap'), robot, IdentifyOptions(), [])
    options = IdentificationOptions(methods=('PR',), holdout=holdout, stretch_s=3.0)
    found = identify(signals, robot, {}, options)
    held = found.held[HELD_OUT]
    stretches = stretches_of(found, signals, held)
    assert len(stretches) == (1 if holdout == 'tail' else len(np.unique(held.block))) > 0
    for time, q, _, effort in stretches:
        learned = found.train.time
        assert not np.any((learned > time[0]) & (learned < time[-1]))
        rows = np.searchsorted(signals.time, time)
        np.testing.assert_array_equal(effort, signals.effort[rows])
        np.testing.assert_allclose(q, signals.position[rows], atol=0.02)
    lengths = sum(time[-1] - time[0] for time, *_ in stretches)
    assert lengths == pytest.approx(len(held.time) / held.rate, rel=0.15)


def test_json_prints_the_findings_alone_on_stdout(folder, tmp_path, capsys):
    command = _command(folder / 'arm.mcap', folder / 'arm.yaml', tmp_path, '--json')
    assert main([*command, '--inputs', 'own:velocity']) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == json.loads((tmp_path / 'identification.json').read_text())
    assert 'The model predicts the effort in the held-out part' in captured.err


def test_a_result_of_an_earlier_run_does_not_pass_for_one_of_this(tmp_path):
    """A robot without URDF leaves none behind in the same folder."""
    with replacing_results(tmp_path, 'identify'):
        write_text(tmp_path / 'robot_identified.urdf', 'old')
    assert main(['simulate', 'linear_axis', '--duration', '10', '--out', str(tmp_path)]) == 0
    assert main(_command(tmp_path / 'linear_axis.mcap', 'linear_axis', tmp_path)) == 0
    assert not (tmp_path / 'robot_identified.urdf').exists()
    assert not list(tmp_path.glob('.sgp_growing_*'))


def test_recordings_to_score_on_keep_apart_where_their_names_do_not():
    """None takes the name of what is learned from, or of another one."""
    named = names_of_tests(['a/day.mcap', 'b/day.mcap', 'train.mcap', 'held out.mcap'])
    assert named == {
        'day': 'a/day.mcap', 'day 2': 'b/day.mcap',
        'train 2': 'train.mcap', 'held out 2': 'held out.mcap',
    }  # fmt: skip


def test_a_robot_is_scored_on_other_recordings_by_name(folder, tmp_path):
    """Without velocities there, none are used; a page and a figure for each."""
    other = [replace(s, velocity=None) for s in arm_samples(10.0, rate=50.0, seed=3)]
    (tmp_path / 'train').mkdir()
    bag = write_bag(tmp_path / 'train' / 'train.mcap', other)
    out = tmp_path / 'out'
    command = _command(folder / 'arm.mcap', folder / 'arm.yaml', out, '--inputs', 'own:velocity')
    assert main([*command, '--test', bag]) == 0
    findings = json.loads((out / 'identification.json').read_text())
    assert findings['held_out'] == ['train 2']
    assert findings['filter']['velocity_source'] == 'position'
    assert findings['scores']['PR']['train 2']['mean_nmse'] < 0.01
    assert (out / 'prediction_train_2.png').is_file()


BAD = {
    'still': ([replace(s, position=STILL, velocity=None) for s in SAMPLES], (), 'moves'),
    'short': (SAMPLES[:40], (), 'record longer'),
    'five states': (SAMPLES[:5], (), '5 states'),
    'sparse': (SAMPLES[::25], (), 'more states per second'),
    'torn': ([s for i, s in enumerate(SAMPLES) if i % 40 < 20], (), 'without gaps'),
    'joints': ([replace(s, names=('a', 'b')) for s in SAMPLES], (), "['a', 'b']"),
    'no effort': ([replace(s, effort=None) for s in SAMPLES], (), 'effort'),
    'NaN effort': (
        [replace(s, effort=frozen_array([np.nan, np.nan])) for s in SAMPLES], (), 'effort',
    ),
    'zero effort': (
        [replace(s, effort=frozen_array([0.0, 0.0])) for s in SAMPLES], (), 'is constant',
    ),
    'commands': (SAMPLES, ('--effort', 'command'), '--command'),
    'inputs': (SAMPLES, ('--inputs', 'own:speed'), 'own:velocity'),
    'share 0': (SAMPLES, ('--share', '0'), 'above 0 and below 1'),
    'share 1': (SAMPLES, ('--share', '1'), 'above 0 and below 1'),
    'share nan': (SAMPLES, ('--share', 'nan'), 'above 0 and below 1'),
    'long stretch': (SAMPLES, ('--holdout', 'alternate', '--stretch', '99'), 'shorter'),
    'no stretch': (SAMPLES, ('--holdout', 'alternate', '--stretch', '0'), 'above 0'),
    'cut-off': (SAMPLES, ('--cutoff', '0.01'), 'another cut-off'),
    'topic': (SAMPLES, ('--joint-states', '/x'), '/joint_states'),
    'test file': (SAMPLES, ('--test', 'nowhere.mcap'), 'nowhere.mcap'),
}  # fmt: skip
"""States, options, and what the line must say."""


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('case', BAD)
def test_bad_input_ends_in_one_line_and_writes_nothing(case, folder, tmp_path, capsys):
    samples, options, said = BAD[case]
    bag = write_bag(tmp_path / 'bad.mcap', samples)
    line = _refused(_command(bag, folder / 'arm.yaml', tmp_path / 'out', *options), capsys)
    assert said in line
    assert 'expected' in line
    assert not (tmp_path / 'out').exists()


def test_a_test_recording_of_another_robot_is_refused_by_its_name(folder, tmp_path, capsys):
    bag = write_bag(tmp_path / 'other.mcap', [replace(s, names=('a', 'b')) for s in SAMPLES])
    command = _command(folder / 'arm.mcap', folder / 'arm.yaml', tmp_path / 'out', '--test', bag)
    assert 'other.mcap' in _refused(command, capsys)


def test_a_file_in_the_place_of_the_results_is_refused_before_anything_is_read(tmp_path, capsys):
    (tmp_path / 'out').write_text('mine')
    line = _refused(_command('nowhere.mcap', 'linear_axis', tmp_path / 'out'), capsys)
    assert 'choose another --out' in line
    assert (tmp_path / 'out').read_text() == 'mine'


@pytest.mark.parametrize('kind', ['gaps', 'no velocity', 'third NaN', 'extra joint'])
def test_recordings_with_flaws_are_identified_all_the_same(kind, folder, tmp_path):
    """Flaws are left out; the rest still finds the friction of the turning joint."""
    robot, samples = folder / 'arm.yaml', SAMPLES
    if kind == 'gaps':
        samples = [s for i, s in enumerate(SAMPLES) if not 500 <= i < 600]
    elif kind == 'no velocity':
        samples = [replace(s, velocity=None) for s in SAMPLES]
    elif kind == 'third NaN':
        nothing = frozen_array([np.nan, np.nan])
        samples = [s if i % 3 else replace(s, effort=nothing) for i, s in enumerate(SAMPLES)]
    else:
        samples = [_with_gripper(s) for s in SAMPLES]
    bag = write_bag(tmp_path / 'flawed.mcap', samples)
    options = ('--inputs', 'own:velocity')
    assert main(_command(bag, robot, tmp_path / 'out', *options)) == 0
    findings = json.loads((tmp_path / 'out' / 'identification.json').read_text())
    found = {p['name']: p['value'] for p in findings['parameters']}
    assert found['turn.coulomb'] == pytest.approx(COULOMB[0], rel=0.05)
    assert found['turn.viscous'] == pytest.approx(VISCOUS[0], rel=0.05)


def test_a_fit_that_a_passive_joint_lets_collapse_ends_in_one_line(tmp_path, capsys):
    """Zero coefficients fit zero efforts best; nothing is reported then."""
    bag = write_bag(tmp_path / 'free.mcap', passive_samples())
    robot = write_arm(tmp_path, 'passive: [lift]\n')
    line = _refused(_command(bag, robot, tmp_path / 'out', '--inputs', 'own:velocity'), capsys)
    assert "passive joints ['lift']" in line
    assert not (tmp_path / 'out').exists()


def _with_gripper(s):
    channels = (s.position, s.velocity, s.effort)
    return replace(
        s, names=('gripper', *s.names),
        **{
            name: frozen_array([np.nan if name == 'effort' else 0.5, *values])
            for name, values in zip(('position', 'velocity', 'effort'), channels, strict=True)
        },
    )  # fmt: skip


def _refused(command, capsys):
    """Run a command that must fail; return its one line."""
    assert main(command) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


SWING = """<mujoco model="swing"><worldbody><body pos="0 0 1">
<joint name="hinge" axis="0 1 0" damping="0.2"/>
<geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>"""


@pytest.fixture(scope='module')
def swing(tmp_path_factory):
    """Return a folder with a recording of efforts, and the same motion as one of targets."""
    folder = tmp_path_factory.mktemp('swing')
    (folder / 'swing.xml').write_text(SWING)
    words = [
        'simulate',
        folder / 'swing.xml',
        '--duration',
        8,
        '--rate',
        200,
        '--out',
        folder,
        '--force',
    ]
    assert main([str(x) for x in words]) == 0
    events = list(open_recording(folder / 'swing.mcap').events())
    states = {e.stamp_ns: e for e in events if isinstance(e, JointSample)}
    with RecordingWriter(folder / 'targets.mcap', command_type=JOINT_STATE) as writer:
        for e in events:
            if isinstance(e, CommandSample) and e.stamp_ns in states:
                now, then = states[e.stamp_ns], states.get(e.stamp_ns + STEP_NS)
                then = now if then is None else then
                q, v = now.position + then.position, now.velocity + then.velocity
                target = q / 2.0 + (e.effort + KD * v / 2.0) / KP
                writer.write_event(CommandSample(e.stamp_ns, target, ('hinge',), POSITION))
                writer.write_event(replace(now, effort=None))
    (folder / 'gains.yaml').write_text(f'kp: {{hinge: {KP}}}\nkd: {{hinge: {KD}}}\n')
    return folder


def test_targets_become_efforts_by_their_gains(swing, tmp_path):
    """Damping and the moment of gravity follow from targets as from efforts."""
    out = tmp_path / 'out'
    words = _command(swing / 'targets.mcap', swing / 'swing.xml', out)
    assert main([*words, '--gains', str(swing / 'gains.yaml')]) == 0
    content = json.loads((out / 'identification.json').read_text())
    found = {p['name']: p['value'] for p in content['parameters'] if p['std']}
    assert found['hinge.viscous'] == pytest.approx(0.2, abs=0.01)
    assert found['body_1.mz'] == pytest.approx(-1.5 * 0.2, abs=0.003)


@pytest.mark.long
def test_a_wrong_connection_is_said_before_bodies_are_estimated(swing, tmp_path, capsys):
    """A recording that contradicts the robot is checked as it is before a diagnosis."""
    with RecordingWriter(tmp_path / 'turned.mcap') as writer:
        for e in open_recording(swing / 'swing.mcap').events():
            is_state = isinstance(e, JointSample)
            writer.write_event(replace(e, position=-e.position + 0.9) if is_state else e)
    out = tmp_path / 'out'
    assert main(_command(tmp_path / 'turned.mcap', swing / 'swing.xml', out)) == 0
    assert 'Check the set-up.' in (out / 'report.html').read_text()
