"""Laws of result files: the old one or the new one, and one run a folder."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sgp_ros.apps.terminal import mark_folder, require_own_folder
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import ConfigError
from sgp_ros.recordings.model_files import load_model, save_model
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report import files
from sgp_ros.report.files import replacing_results, write_text
from sgp_ros.strangers import create_beside


def test_two_runs_into_one_folder_are_not_mixed(tmp_path):
    """The second one is told who is there; the folder is free again afterwards."""
    with replacing_results(tmp_path, 'replay'):
        second = replacing_results(tmp_path, 'replay')
        with pytest.raises(ConfigError, match=f'process {os.getpid()}'):
            second.__enter__()
        with replacing_results(tmp_path, 'identify'):
            pass
    with replacing_results(tmp_path, 'replay'):
        pass
    assert not list(tmp_path.glob('*.lock'))


def test_a_lock_that_its_run_removes_in_between_is_none(tmp_path, monkeypatch):
    """A file that was opened before it was removed keeps nobody else out."""
    calls = []

    def flock(handle, operation):
        calls.append(operation)
        if len(calls) == 1:  # the run before ends here
            (tmp_path / '.sgp_replay.lock').unlink()

    monkeypatch.setattr(files.fcntl, 'flock', flock)
    with replacing_results(tmp_path, 'replay'):
        assert (tmp_path / '.sgp_replay.lock').read_text() == f'process {os.getpid()}\n'
    assert len(calls) == 2


def test_the_next_run_removes_what_a_killed_one_left(tmp_path):
    program = (
        'import os, signal; from pathlib import Path\n'
        'from sgp_ros.strangers import create_beside\n'
        f'create_beside(Path({str(tmp_path / "x.json")!r})); os.kill(os.getpid(), signal.SIGKILL)'
    )
    done = subprocess.run([sys.executable, '-c', program], check=False)
    assert done.returncode == -9
    stream, mine = create_beside(tmp_path / 'y.json')
    assert len(list(tmp_path.glob('.sgp_growing_*'))) == 2
    with replacing_results(tmp_path, 'replay'):
        assert list(tmp_path.glob('.sgp_growing_*')) == [mine]
    stream.close()


def test_nothing_is_written_through_a_link(tmp_path):
    """In a folder that everybody may write to, a link would choose where a result goes."""
    victim = tmp_path / 'victim'
    victim.write_text('mine')
    (tmp_path / 'x.json').symlink_to(victim)
    write_text(tmp_path / 'x.json', 'result')
    assert victim.read_text() == 'mine'
    assert (tmp_path / 'x.json').read_text() == 'result'
    (tmp_path / '.sgp_replay.lock').symlink_to(victim)
    with pytest.raises(ConfigError, match='is a link'), replacing_results(tmp_path, 'replay'):
        pass
    assert victim.read_text() == 'mine'


def _replace(out, **content):
    with replacing_results(out, 'replay'):
        for name, text in content.items():
            write_text(out / name, text)


def _fail(out, **content):
    with replacing_results(out, 'replay'):
        for name, text in content.items():
            write_text(out / name, text)
        1 / 0  # noqa: B018 - any error


def test_results_appear_together_or_not_at_all(tmp_path):
    """Until the last of them is complete those of the run before are all there."""
    _replace(tmp_path, a='old', b='old')
    with replacing_results(tmp_path, 'replay'):
        write_text(tmp_path / 'a', 'half')
        write_text(tmp_path / 'a', 'new')
        write_text(tmp_path / 'c', 'new')
        assert {path.name for path in tmp_path.glob('[a-c]')} == {'a', 'b'}
        assert (tmp_path / 'a').read_text() == 'old'
    assert {path.name: path.read_text() for path in tmp_path.glob('[a-c]')} == {
        'a': 'new', 'c': 'new',
    }  # fmt: skip
    assert [path.name for path in tmp_path.glob('.*')] == ['.sgp_replay.json']
    with pytest.raises(ZeroDivisionError):
        _fail(tmp_path, a='newer')
    assert (tmp_path / 'a').read_text() == 'new'
    assert [path.name for path in tmp_path.glob('.*')] == ['.sgp_replay.json']


def test_every_writer_of_results_waits_for_the_others(tmp_path):
    """Models and recordings too, and none is lost on the way."""
    sample = JointSample(10**18, ('a',), np.zeros(1))
    with replacing_results(tmp_path, 'replay'):
        save_model(tmp_path / 'model.npz', {'a': np.ones(3)})
        with RecordingWriter(tmp_path / 'x.mcap') as writer:
            writer.write_event(sample)
        write_text(tmp_path / 'x.json', '1')
        assert not list(tmp_path.glob('[a-z]*'))
    assert {path.name for path in tmp_path.glob('[a-z]*')} == {
        'model.npz', 'x.mcap', 'x.json',
    }  # fmt: skip
    assert load_model(tmp_path / 'model.npz')['a'].tolist() == [1.0, 1.0, 1.0]
    assert len(list(open_recording(tmp_path / 'x.mcap').events())) == 1


def test_the_next_run_completes_what_was_cut_off_between_two_names(tmp_path, monkeypatch):
    """Also where that run fails: the results of one run are whole again."""
    _replace(tmp_path, a='old', b='old')
    replace = Path.replace

    def cut_off(self, target):
        if target.name == 'c':
            raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, 'replace', cut_off)
    with pytest.raises(KeyboardInterrupt):
        _replace(tmp_path, a='new', c='new')
    monkeypatch.undo()
    assert {path.name for path in tmp_path.glob('[a-c]')} == {'a', 'b'}
    (tmp_path / '.sgp_replay.json').unlink()
    require_own_folder(tmp_path)  # by the note alone
    with pytest.raises(ZeroDivisionError):
        _fail(tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.glob('[a-c]')} == {
        'a': 'new', 'c': 'new',
    }  # fmt: skip
    assert not list(tmp_path.glob('.sgp_growing_*'))
    assert not list(tmp_path.glob('.sgp_*.moves'))


def test_results_take_their_places_also_without_their_run(tmp_path, monkeypatch):
    """A kill of the run and its group, while the names change, leaves the results of one run."""
    _replace(tmp_path, a='old', b='old')
    replace, run = Path.replace, []
    reader, writer = os.pipe()

    def slowly(self, target):
        if target.name == 'a':
            os.killpg(run[0], signal.SIGKILL)
            time.sleep(0.2)
        os.write(writer, b'x')
        return replace(self, target)

    monkeypatch.setattr(Path, 'replace', slowly)
    if not (child := os.fork()):
        os.setpgrp()
        run.append(os.getpid())
        _replace(tmp_path, a='new', c='new')
        os._exit(0)
    os.close(writer)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    with os.fdopen(reader, 'rb') as stream:
        stream.read()  # until the last process that has the other end is gone
    assert {path.name: path.read_text() for path in tmp_path.glob('[a-c]')} == {
        'a': 'new', 'c': 'new',
    }  # fmt: skip
    assert [path.name for path in tmp_path.glob('.sgp_*.moves')] == []


@pytest.mark.parametrize('why', ['no process', 'nobody waits'])
def test_results_take_their_places_without_another_process_too(tmp_path, monkeypatch, why):
    """A system out of memory gives none; a parent may have left ended children to nobody."""
    before = signal.getsignal(signal.SIGCHLD)
    if why == 'no process':
        monkeypatch.setattr(os, 'fork', lambda: Path('/nowhere').stat())
    else:
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        _replace(tmp_path, a='new')
    finally:
        signal.signal(signal.SIGCHLD, before)
    assert (tmp_path / 'a').read_text() == 'new'
    assert [path.name for path in tmp_path.glob('.*')] == ['.sgp_replay.json']


def test_a_note_of_moves_reaches_no_other_folder(tmp_path):
    """It may be somebody else's, in a folder that everybody may write to."""
    out, victim = tmp_path / 'out', tmp_path / 'victim'
    out.mkdir()
    victim.write_text('mine')
    (out / '.sgp_growing_1_x').write_text('theirs')
    (out / '.sgp_replay.moves').write_text(
        '{"moves": {".sgp_growing_1_x": "../victim", "../victim": "y"}, "stale": ["../victim"]}'
    )
    with replacing_results(out, 'replay'):
        pass
    assert victim.read_text() == 'mine'
    assert not (out / 'y').exists()


NOTES = {
    'others': {
        'moves': {'.sgp_growing_1_x': ['theirs.txt', None], '.sgp_growing_1_y': 'z'},
        'stale': {'mine.txt': [1, 5]},
        'listing': {'theirs.txt': None, 'mine.txt': [1, 5]},
    },
    'as it was': {
        'moves': {'.sgp_growing_1_x': 'mine.txt'}, 'stale': ['mine.txt'], 'listing': {},
    },
    'names': {'moves': {}, 'stale': {'..': [], 'a\0b': [], '': None, '.': 1}, 'listing': {}},
    'kinds': {'moves': {'.sgp_growing_1_x': [[], 1]}, 'stale': {'mine.txt': None}, 'listing': {}},
}  # fmt: skip


@pytest.mark.parametrize('kind', [*NOTES, 'deep', 'large', 'pipe', 'link', 'listing'])
def test_a_strangers_note_changes_no_file_of_the_folder(tmp_path, kind):
    """Nor does it hold a run up, end it, or make the folder one that a command may write to."""
    note = tmp_path / '.sgp_replay.moves'
    (tmp_path / 'mine.txt').write_text('mine')
    (tmp_path / '.sgp_growing_1_x').write_text('theirs')
    if kind == 'pipe':
        os.mkfifo(note)
    elif kind == 'link':
        note.symlink_to('/dev/zero')
    elif kind == 'listing':
        note.with_suffix('.json').symlink_to(tmp_path / 'nowhere')
    elif kind == 'deep':
        note.write_text('[' * 100_000)
    else:
        note.write_text(json.dumps(NOTES.get(kind, {})) + ' ' * (kind == 'large') * (5 << 20))
    with pytest.raises(ConfigError, match='did not write'):
        require_own_folder(tmp_path)
    _replace(tmp_path, metrics='{}')
    assert (tmp_path / 'mine.txt').read_text() == 'mine'
    assert {path.name for path in tmp_path.iterdir()} == {
        'mine.txt', 'metrics', '.sgp_growing_1_x', '.sgp_replay.json',
    }  # fmt: skip
    require_own_folder(tmp_path)


def test_a_sign_is_not_left_through_a_link(tmp_path):
    (tmp_path / '.sgp_campaign.json').symlink_to(tmp_path / 'nowhere')
    mark_folder(tmp_path, 'campaign')
    assert [path.name for path in tmp_path.iterdir()] == ['.sgp_campaign.json']
    assert (tmp_path / '.sgp_campaign.json').read_text() == '{}\n'


@pytest.mark.parametrize('moment', ['beside a growing file', 'before the names'])
def test_an_interrupted_run_leaves_no_growing_file(tmp_path, monkeypatch, moment):
    """Wherever the signal comes: after a file was made, or once all of them are complete."""

    def interrupt(*_):
        raise KeyboardInterrupt

    def run():
        with replacing_results(tmp_path, 'replay'):
            write_text(tmp_path / 'metrics.json', '{}')
            if moment != 'before the names':
                create_beside(tmp_path / 'report.html')[0].close()
                interrupt()

    if moment == 'before the names':
        monkeypatch.setattr(files, '_note_moves', interrupt)
    with pytest.raises(KeyboardInterrupt):
        run()
    assert not list(tmp_path.iterdir())


def test_an_interrupt_takes_nothing_that_has_a_name_to_come(tmp_path, monkeypatch):
    """Noted moves are completed by the next run."""
    make_moves, calls = files._make_moves, []

    def cut_off(out, command, content):
        calls.append(command)
        if len(calls) == 2:
            raise OSError('no space')
        make_moves(out, command, content)

    monkeypatch.setattr(files, '_make_moves', cut_off)
    with pytest.raises(OSError, match='no space'), replacing_results(tmp_path, 'replay'):
        write_text(tmp_path / 'metrics.json', '{}')
    with replacing_results(tmp_path, 'replay'):
        assert (tmp_path / 'metrics.json').read_text() == '{}'
