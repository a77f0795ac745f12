"""The command line: results, and one line with status 2 for bad input."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.apps.arguments import COMMANDS
from sgp_ros.cli import INTERNAL_ERROR, INTERRUPTED, Progress, _parser, main
from sgp_ros.engine.samples import CommandSample, JointSample, frozen_array
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope='module')
def wheel(tmp_path_factory):
    """A simulated recording of 12 s and its truth."""
    folder = tmp_path_factory.mktemp('wheel')
    assert main(['simulate', 'reaction_wheel', '--duration', '12', '--out', str(folder)]) == 0
    return folder


def _refused(arguments, capsys):
    """Run a command that must fail; return its one line."""
    assert main([str(a) for a in arguments]) == 2
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, lines
    assert 'Traceback' not in captured.err
    return lines[0]


def _replay(bag, tmp_path, *options, robot='reaction_wheel'):
    return ['replay', bag, '--robot', robot, '--out', tmp_path / 'out', *options]


def test_a_simulated_recording_is_identified(wheel, tmp_path, capsys):
    """The ten coefficients are found within five standard deviations, and printed with truth."""
    arguments = _replay(wheel / 'reaction_wheel.mcap', tmp_path, '--truth', wheel / 'truth.json')
    assert main([str(a) for a in [*arguments, '--json']]) == 0
    captured = capsys.readouterr()
    metrics = json.loads(captured.out)
    truth = json.loads((wheel / 'truth.json').read_text())['coefficients']
    for parameter in metrics['parameters']:
        error = abs(parameter['value'] - truth[parameter['name']]['value'])
        assert error < 5 * parameter['std'], parameter
    assert 'true' in captured.err
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert 'true value' in page


def test_simulation_is_a_function_of_its_seed(tmp_path):
    """The same seed writes the same events; another seed others."""
    seeds = {'usual': [], 'same': ['--seed', '0'], 'other': ['--seed', '1']}
    for name, seed in seeds.items():
        command = ['simulate', 'reaction_wheel', '--duration', '2', *seed]
        assert main([*command, '--out', str(tmp_path / name)]) == 0

    def positions(name):
        recording = open_recording(tmp_path / name / 'reaction_wheel.mcap')
        return [e.position for e in recording.events() if isinstance(e, JointSample)]

    np.testing.assert_array_equal(positions('usual'), positions('same'))
    assert not np.array_equal(positions('usual'), positions('other'))


def test_left_out_effects_reach_the_recording_and_the_truth(tmp_path):
    """--effect and --physical change the machine and are written to truth.json."""
    command = ['simulate', 'reaction_wheel', '--duration', '2', '--out', str(tmp_path)]
    effect = 'coulomb_friction:joint=pole,level=0.02'
    assert main([*command, '--effect', effect, '--physical', 'pole_viscosity=0']) == 0
    truth = json.loads((tmp_path / 'truth.json').read_text())
    assert any(e.get('effect', e.get('name')) == 'coulomb_friction' for e in truth['effects'])


@pytest.mark.parametrize(
    'robot', ['toy_pendulum', pytest.param('linear_axis', marks=pytest.mark.long)]
)
def test_every_simulated_robot_replays(robot, tmp_path):
    """Simulate, then identify with the robot of the same name."""
    assert main(['simulate', robot, '--duration', '15', '--out', str(tmp_path)]) == 0
    bag = tmp_path / f'{robot}.mcap'
    assert main([str(a) for a in _replay(bag, tmp_path, robot=robot)]) == 0
    metrics = json.loads((tmp_path / 'out' / 'metrics.json').read_text())
    assert metrics['estimates']['scored'] > 0


def test_a_missing_file_is_refused(tmp_path, capsys):
    """Found, and what was expected."""
    line = _refused(_replay(tmp_path / 'nothing.mcap', tmp_path), capsys)
    assert 'nothing.mcap' in line
    assert '.mcap file' in line


def test_an_empty_bag_is_refused(tmp_path, capsys):
    """A recording without messages says so."""
    with RecordingWriter(tmp_path / 'empty.mcap'):
        pass
    assert 'no message' in _refused(_replay(tmp_path / 'empty.mcap', tmp_path), capsys)


def test_a_bag_without_joint_states_is_refused(tmp_path, capsys):
    """The line lists the topics that are there."""
    with RecordingWriter(tmp_path / 'commands.mcap') as writer:
        writer.write_event(CommandSample(1, frozen_array([1.0])))
    line = _refused(_replay(tmp_path / 'commands.mcap', tmp_path), capsys)
    assert 'JointState' in line
    assert '/command' in line


def test_a_file_that_is_no_bag_is_refused(tmp_path, capsys):
    """Any other content."""
    (tmp_path / 'text.mcap').write_text('hello')
    _refused(_replay(tmp_path / 'text.mcap', tmp_path), capsys)


def test_an_unknown_joint_is_refused_with_both_lists(wheel, tmp_path, capsys):
    """The recording's joints, the robot's, and how to rename."""
    line = _refused(_replay(wheel / 'reaction_wheel.mcap', tmp_path, robot='linear_axis'), capsys)
    for part in ('pole', 'axis', 'joints:'):
        assert part in line


@pytest.mark.parametrize(
    ('text', 'parts'),
    [
        ('/**:\n  ros__parameters:\n    filter.windw: 1.0', ['filter.windw']),
        ('/**:\n  ros__parameters:\n    filter: {window: far, degree: 99}',
         ['filter.window', 'filter.degree', '2 wrong']),
        ('/**:\n  parameters:\n    a: 1', ['ros__parameters']),
        ('[1]', ['list']),
        ('a: [', ['not YAML']),
    ],
)  # fmt: skip
def test_a_wrong_parameter_file_is_refused(text, parts, wheel, tmp_path, capsys):
    """All problems at once, in one line."""
    path = tmp_path / 'params.yaml'
    path.write_text(text)
    line = _refused(_replay(wheel / 'reaction_wheel.mcap', tmp_path, '--params', path), capsys)
    for part in parts:
        assert part in line


def test_other_bad_input_is_refused(wheel, tmp_path, capsys):
    """Robots, models, truths, maps, effects, durations that do not exist or do not fit."""
    bag = wheel / 'reaction_wheel.mcap'
    (tmp_path / 'no.npz').write_bytes(b'PK nothing')
    cases = [
        _replay(bag, tmp_path, robot='unicycle'),
        _replay(bag, tmp_path, '--params', tmp_path / 'nothing.yaml'),
        _replay(bag, tmp_path, '--model', tmp_path / 'nothing.npz'),
        _replay(bag, tmp_path, '--model', tmp_path / 'no.npz'),
        _replay(bag, tmp_path, '--truth', tmp_path / 'nothing.json'),
        _replay(bag, tmp_path, '--joint-states', '/nowhere'),
        _replay(bag, tmp_path, '--command', '/nowhere'),
        ['simulate', 'unicycle', '--out', tmp_path],
        ['simulate', 'reaction_wheel', '--effect', 'gremlins:joint=pole', '--out', tmp_path],
        ['simulate', 'reaction_wheel', '--duration', '-1', '--out', tmp_path],
        ['import', tmp_path / 'nothing.csv', '--map', ROOT / 'config/import/emps.yaml'],
        ['demo', '--duration', '0', '--out', tmp_path],
    ]
    for arguments in cases:
        _refused(arguments, capsys)


def test_a_recording_without_its_commands_says_what_to_do(wheel, tmp_path, capsys):
    """All states are unpaired: name the topic."""
    arguments = _replay(wheel / 'reaction_wheel.mcap', tmp_path, '--command', 'none')
    assert '--command' in _refused(arguments, capsys)


def test_a_truncated_recording_is_used_as_far_as_it_goes(tmp_path):
    """The completed part is read, and the report says how much."""
    with RecordingWriter(tmp_path / 'long.mcap') as writer:
        for i in range(1500):
            stamp = 10**18 + i * 10_000_000
            writer.write_event(CommandSample(stamp, frozen_array([np.sin(0.05 * i)])))
            names = ('pole', 'wheel')
            position = frozen_array([np.pi + 0.1 * np.sin(0.03 * i), 0.2 * np.sin(0.05 * i)])
            writer.write_event(JointSample(stamp, names, position))
            if i % 500 == 0:
                writer.flush()
    whole = (tmp_path / 'long.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(whole[: int(0.8 * len(whole))])
    assert main([str(a) for a in _replay(tmp_path / 'cut.mcap', tmp_path)]) == 0
    metrics = json.loads((tmp_path / 'out' / 'metrics.json').read_text())
    assert 500 <= metrics['samples']['used'] < 1500
    (said,) = (remark for remark in metrics['remarks'] if 'recovered' in remark)
    assert 'the rest is damaged, from byte' in said
    assert said in (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')


def test_strange_states_are_counted_and_survived(tmp_path):
    """NaN, infinite, repeated, backward and zero stamps, changing order: read = used + refused."""
    rng = np.random.default_rng(0)
    with RecordingWriter(tmp_path / 'strange.mcap') as writer:
        for i in range(1000):
            stamp = 10**18 + i * 10_000_000
            kind = rng.integers(0, 40)
            position = [np.pi + 0.3 * np.sin(0.03 * i), 0.2 * np.sin(0.07 * i)]
            names = ('pole', 'wheel')
            if kind == 0:
                position[0] = np.nan
            elif kind == 1:
                position[1] = np.inf
            elif kind == 2:
                names = ('pole', 'elbow')
            elif kind == 3:
                stamp = 10**18 + max(i - 50, 0) * 10_000_000
            if kind > 20:
                names, position = names[::-1], position[::-1]
            command = [1.0, 2.0] if kind == 4 else [np.sin(0.07 * i)]
            writer.write_event(CommandSample(10**18 + i * 10_000_000, frozen_array(command)))
            writer.write_event(JointSample(stamp, names, frozen_array(position)))
    assert main([str(a) for a in _replay(tmp_path / 'strange.mcap', tmp_path)]) == 0
    metrics = json.loads((tmp_path / 'out' / 'metrics.json').read_text())
    samples = metrics['samples']
    assert samples['read'] == 1000 == samples['used'] + sum(samples['refused'].values())
    for reason in ('nonfinite', 'unknown_joint', 'duplicate'):
        assert samples['refused'][reason] > 0
    assert metrics['commands']['refused']['wrong_length'] > 0


def test_results_replace_older_ones_and_leave_no_parts(tmp_path):
    """A second run takes away what only the first one drew, and nothing that is not its own."""
    assert main(['simulate', 'reaction_wheel', '--duration', '3', '--out', str(tmp_path)]) == 0
    arguments = [str(a) for a in _replay(tmp_path / 'reaction_wheel.mcap', tmp_path)]
    out = tmp_path / 'out'
    out.mkdir()
    for name in ('stale.png', 'edited.png', 'mine.png'):
        (out / name).write_text(name)
    stale = {}
    for name in ('stale.png', 'edited.png'):
        stat = (out / name).stat()
        stale[name] = [stat.st_mtime_ns, stat.st_size]
    (out / '.sgp_replay.json').write_text(json.dumps(stale))
    (out / 'edited.png').write_text('by the user since')
    assert main(arguments) == 0
    assert {path.name for path in out.glob('*.png')} >= {'edited.png', 'mine.png'}
    assert not (out / 'stale.png').exists()
    first = (tmp_path / 'out' / 'robot_identified.yaml').read_text()
    assert main(arguments) == 0
    assert (tmp_path / 'out' / 'robot_identified.yaml').read_text() == first
    assert not list((tmp_path / 'out').glob('.sgp_growing_*'))


def test_help_shows_an_example(capsys):
    """Every command has one."""
    for command in ('demo', 'robots', 'simulate', 'replay', 'identify', 'diagnose', 'import',
                    'reproduce'):  # fmt: skip
        with pytest.raises(SystemExit) as caught:
            main([command, '--help'])
        assert caught.value.code == 0
        assert f'example: sgp {command}' in capsys.readouterr().out


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        ('identify x --robot y --cutoff -1', "--cutoff: '-1', expected a number above 0"),
        ('identify x --robot y --cutoff nan', "--cutoff: 'nan'"),
        ('identify x --robot y --share 1', "--share: '1', expected a number above 0 and below 1"),
        ('identify x --robot y --stretch 0', "--stretch: '0'"),
        ('simulate x --duration inf', "--duration: 'inf'"),
        ('simulate x --rate 0', "--rate: '0'"),
        ('simulate x --rate fast', "--rate: 'fast', expected a number above 0"),
        ('simulate x --seed -1', "--seed: '-1', expected an integer from 0"),
        ('simulate x --seed 1.5', "--seed: '1.5'"),
        ('demo --duration nan', "--duration: 'nan'"),
        ('reproduce --seeds 0', '0 seeds; expected at least one'),
    ],
)
def test_a_number_that_makes_no_sense_is_refused_as_it_was_given(arguments, said, capsys):
    """The message quotes the input as the user wrote it, beside the expected one."""
    assert said in _refused(arguments.split(), capsys)


@pytest.mark.parametrize('words', ['--help', ''])
def test_the_help_groups_the_commands_and_shows_an_example(words, capsys):
    """Also those that other packages add; each stands there once. It comes unasked too."""
    with pytest.raises(SystemExit):
        main(words.split())
    text = capsys.readouterr().out
    parts = ('Explore', '  demo ', 'Analyse a', '  diagnose ', 'Work with', '  bench ')
    at = [text.index(part) for part in (*parts, 'example')]
    assert at == sorted(at)
    assert text.count('\n  diagnose ') == 1


def test_the_robots_that_come_with_the_package_are_listed(capsys):
    """JSON has stdout for itself, the text goes to stderr; quiet, it goes nowhere."""
    assert main(['robots', '--json']) == 0
    captured = capsys.readouterr()
    listed = {entry['name']: entry['joints'] for entry in json.loads(captured.out)['robots']}
    assert listed['reaction_wheel'] == ['pole', 'wheel']
    assert 'reaction_wheel' in captured.err
    assert 'next: ' in captured.err
    assert main(['robots', '--quiet']) == 0
    assert capsys.readouterr().out == ''


def test_a_file_instead_of_a_command_is_told_what_to_do_with_it(tmp_path, capsys):
    """A table is imported, a model simulated, a recording diagnosed."""
    for name, then in (('a.csv', 'sgp import'), ('a.urdf', '--robot'), ('a.mcap', 'sgp diagnose')):
        (tmp_path / name).write_text('x')
        assert then in _refused([tmp_path / name], capsys)
    (tmp_path / 'table.csv').write_text('t,q\n0,1\n')
    assert 'sgp import' in _refused(_replay(tmp_path / 'table.csv', tmp_path), capsys)


@pytest.mark.long
def test_files_of_somebody_else_are_not_mixed_with_results(wheel, tmp_path, capsys):
    """But by force; a folder that a command of ours wrote to is ours."""
    out = tmp_path / 'out'
    out.mkdir()
    (out / 'thesis.tex').write_text('mine')
    arguments = _replay(wheel / 'reaction_wheel.mcap', tmp_path)
    for command in (arguments, ['effects', '--out', out], ['simulate', 'pole', '--out', out]):
        assert 'thesis.tex' in _refused(command, capsys)
    assert main([str(a) for a in [*arguments, '--force']]) == 0
    assert main([str(a) for a in arguments]) == 0
    assert (out / 'thesis.tex').read_text() == 'mine'


@pytest.mark.parametrize(
    ('first', 'second', 'gone'),
    [
        ('simulate toy_pendulum --duration 1', 'simulate double_pendulum --duration 1',
         'toy_pendulum.mcap'),
        ('export double_pendulum --to urdf', 'export double_pendulum --to sdf',
         'double_pendulum.urdf'),
    ],
)  # fmt: skip
def test_a_used_folder_is_replaced_whole(first, second, gone, tmp_path):
    """Files of an earlier command that this one does not write would be taken for its result."""
    for command in (first, second):
        assert main([*command.split(), '--out', str(tmp_path), '--quiet']) == 0
        assert (tmp_path / gone).exists() == (command == first)
    assert not list(tmp_path.glob('.sgp_growing_*'))


def test_a_file_is_no_folder_of_results(tmp_path, capsys):
    """One line, and it stays."""
    path = tmp_path / 'thesis.tex'
    path.write_text('mine')
    assert 'is a file' in _refused(['effects', '--out', path], capsys)
    assert path.read_text() == 'mine'


def test_an_import_replaces_its_own_recording_alone(tmp_path, capsys):
    """It lies beside the log that it was, and makes the folder nobody's but the user's."""
    table = tmp_path / 'log.csv'
    rows = (f'{0.01 * i:.2f},{0.1 * i:.3f},1.0' for i in range(100))
    table.write_text('\n'.join(['time,arm_position,arm_effort', *rows]))
    command = ['import', table, '--out', tmp_path]
    recording = tmp_path / 'log.mcap'
    recording.write_bytes(b'mine')
    assert 'log.mcap exists' in _refused(command, capsys)
    assert recording.read_bytes() == b'mine'
    recording.unlink()
    for _ in range(2):
        assert main([str(a) for a in command]) == 0
    capsys.readouterr()
    assert 'log.csv' in _refused(['effects', '--out', tmp_path], capsys)
    table.unlink()
    assert main(['effects', '--out', str(tmp_path), '--quiet']) == 0
    assert recording.exists()


@pytest.mark.parametrize('given', ['nothing', 'map'])
def test_an_import_keeps_maps_and_gains_that_it_did_not_write(tmp_path, capsys, given):
    """Nor one that was corrected since."""
    table, own = tmp_path / 'log.csv', tmp_path / 'log_map.yaml'
    rows = ''.join(f'{0.01 * i:.2f},{np.sin(0.1 * i):.6f},0.1\n' for i in range(50))
    table.write_text('t,q,v\n' + rows)
    command = ['import', table, '--out', tmp_path]
    if given == 'map':
        q, v = (f'{{position: {{column: {name}, unit: rad}}}}' for name in 'qv')
        own.write_text(
            f'time: {{column: t, unit: s}}\njoints: {{a: {q}}}\ntargets: {{a: {v}}}\n'
            'gains: {kp: {a: 3.0}, kd: {a: 1.0}}\n'
        )
        command, own = [*command, '--map', own], tmp_path / 'log_gains.yaml'
    own.write_text('mine')
    assert f'{own.name} exists' in _refused(command, capsys)
    assert own.read_text() == 'mine'
    assert not (tmp_path / 'log.mcap').exists()
    command = [str(word) for word in command]
    assert main([*command, '--force']) == 0
    assert main(command) == 0
    capsys.readouterr()
    own.write_text('corrected')
    assert f'{own.name} exists' in _refused(command, capsys)
    assert own.read_text() == 'corrected'


def test_a_path_that_is_too_long_is_refused(tmp_path, capsys):
    out = '/'.join([str(tmp_path), *['d' * 200] * 25])
    assert 'too long' in _refused(['effects', '--out', out], capsys)


def test_a_file_name_that_is_no_text_is_shown_escaped(tmp_path, capfd):
    path = str(tmp_path / 'swing\udcff.mcap')
    with RecordingWriter(tmp_path / 'x.mcap') as writer:
        for i in range(300):
            x = frozen_array(np.zeros(2))
            stamp = 10**18 + i * 10**7
            writer.write_event(JointSample(stamp, ('pole', 'wheel'), x, effort=x))
    shutil.move(tmp_path / 'x.mcap', path)
    for command in ('check', 'replay'):
        out = tmp_path / command
        assert main([command, path, '--robot', 'reaction_wheel', '--out', str(out)]) == 0
        assert 'swing\\udcff' in next(out.glob('*.html')).read_text()


def test_a_reader_that_has_seen_enough_is_no_error():
    """As in `sgp effects | head -1`: nothing is complained of."""
    done = subprocess.run(
        f'{sys.executable} -m sgp_ros.cli robots | head -n 1',
        shell=True, capture_output=True, text=True, check=True, cwd=ROOT,
    )  # fmt: skip
    assert done.stdout.count('\n') == 1
    assert done.stderr == ''


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        ('--help', 'simulate'), ('--version', 'sgp'), ('diagnose --help', '--robot'),
        ('robots', 'pole, wheel'), ('effects', 'viscous_friction'),
    ],
)  # fmt: skip
def test_help_comes_without_what_computes(words, said, tmp_path):
    """A user who asks what there is does not wait for NumPy, nor for a search of packages.

    What Python itself loads at its start, as by `.pth` files, is not counted.
    """
    slow = {
        'numpy', 'scipy', 'rosbags', 'matplotlib', 'jinja2', 'rclpy', 'argcomplete', 'numba',
        'pinocchio', 'importlib.metadata', 'email', 'dataclasses', 'inspect', 'yaml',
    }  # fmt: skip
    code = (
        'import sys; before = set(sys.modules)\n'
        'from sgp_ros.cli import main\n'
        f'try: main({words.split()})\n'
        'except SystemExit: pass\n'
        f'assert not ({slow} & set(sys.modules)) - before'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


def test_one_command_builds_no_parser_of_another():
    """All of them take half as long as Python itself."""
    assert list(_parser(['diagnose', '--help']).summaries) == ['diagnose']
    assert set(_parser(['--help']).summaries) > set(COMMANDS)


def test_an_interrupt_while_a_command_cleans_up_is_one_too(tmp_path, monkeypatch, capsys):
    """The second of two; later ones do what they did before."""
    before = signal.getsignal(signal.SIGTERM)

    def end(*_):
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr('sgp_ros.cli.require_own_folder', end)
    monkeypatch.setattr(Path, 'rmdir', end)
    assert main(['effects', '--out', str(tmp_path / 'out')]) == INTERRUPTED
    assert capsys.readouterr().err == 'sgp effects: interrupted\n'
    assert signal.getsignal(signal.SIGTERM) is before


def test_another_package_adds_a_command_by_an_entry_point(tmp_path, monkeypatch, capsys):
    """An installed package with the group is all that it takes; a broken one costs a remark."""
    (tmp_path / 'waiting.py').write_text(
        'def add_commands(add):\n'
        "    parser = add('wait', 'waiting:wait', 'Wait.', 'sgp wait 3')\n"
        "    parser.add_argument('seconds', type=float)\n"
        'def wait(seconds, out, progress):\n'
        "    return {'waited': seconds}\n"
    )
    folder = tmp_path / 'waiting-1.dist-info'
    folder.mkdir()
    (folder / 'METADATA').write_text('Metadata-Version: 2.1\nName: waiting\nVersion: 1\n')
    (folder / 'entry_points.txt').write_text(
        '[sgp_ros.commands]\nwaiting = waiting:add_commands\nbroken = nowhere:add_commands\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert main(['wait', '3', '--json']) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {'waited': 3.0}
    assert captured.err.splitlines() == [
        "sgp: no commands of nowhere:add_commands: No module named 'nowhere'"
    ]


def test_progress_is_silent_where_nobody_watches(capsys):
    """No bar in a log file."""
    Progress('test')(0.5)
    assert capsys.readouterr().err == ''


@pytest.mark.long
def test_split_directories_replay_like_one_file(wheel, tmp_path):
    """A rosbag2 folder of several files is one recording."""
    folder = tmp_path / 'split'
    folder.mkdir()
    events = list(open_recording(wheel / 'reaction_wheel.mcap').events())
    for part in range(3):
        with RecordingWriter(folder / f'split_{part}.mcap') as writer:
            for event in events[part * 800 : (part + 1) * 800]:
                writer.write_event(event)
    one, other = tmp_path / 'one', tmp_path / 'other'
    for bag, out in ((wheel / 'reaction_wheel.mcap', one), (folder, other)):
        shutil.rmtree(out, ignore_errors=True)
        arguments = ['replay', str(bag), '--robot', 'reaction_wheel', '--out', str(out)]
        assert main(arguments) == 0
    first, second = (json.loads((out / 'metrics.json').read_text()) for out in (one, other))
    assert first['parameters'] == second['parameters']


def test_the_recording_in_the_repository_is_identified(tmp_path):
    """The command of bags/README.md: all ten coefficients within five standard deviations."""
    bag, truth = ROOT / 'bags/reaction_wheel.mcap', ROOT / 'bags/reaction_wheel_truth.json'
    assert main([str(a) for a in _replay(bag, tmp_path, '--truth', truth)]) == 0
    metrics = json.loads((tmp_path / 'out' / 'metrics.json').read_text())
    true = json.loads(truth.read_text())['coefficients']
    for parameter in metrics['parameters']:
        error = abs(parameter['value'] - true[parameter['name']]['value'])
        assert error < 5 * parameter['std'], parameter


@pytest.mark.parametrize(
    'error', [KeyError('a\nb'), RecursionError('deep'), ValueError('x' * 9999)]
)
def test_an_internal_error_is_one_line_and_a_traceback_where_asked_for(error, monkeypatch, capsys):
    """Its status differs from that of bad input, so that what looks for bugs sees it."""

    def broken(**_):
        raise error

    monkeypatch.setattr('sgp_ros.cli._load', lambda _place: broken)
    with pytest.raises(type(error)):
        main(['robots'])
    monkeypatch.delenv('SGP_DEBUG')
    assert main(['robots']) == INTERNAL_ERROR
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert said.startswith(f'sgp robots: internal error: {type(error).__name__}')
    assert len(said) < 500


def test_numbers_that_overflow_print_no_warning_of_numpy(monkeypatch):
    """A caller who filters warnings himself has his way."""

    def overflowing(**_):
        warnings.warn_explicit('overflow', RuntimeWarning, 'x.py', 1)
        return {}

    monkeypatch.setattr('sgp_ros.cli._load', lambda _place: overflowing)
    with warnings.catch_warnings(record=True) as printed:
        warnings.resetwarnings()
        assert main(['robots']) == 0
    assert not printed
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        with pytest.raises(RuntimeWarning):
            main(['robots'])
