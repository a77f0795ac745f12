"""Folders of intermediate files: they go with their process, or by the next run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile

import pytest

from sgp_ros.cli import main
from sgp_ros.scratch import Scratch, sweep


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    return tmp_path


def test_a_folder_goes_with_its_object(folder):
    with Scratch() as path:
        (path / 'x').touch()
        assert [*folder.iterdir()] == [path]
    assert not [*folder.iterdir()]


def test_what_a_killed_process_left_is_removed_by_the_next(folder):
    program = (
        'from sgp_ros.scratch import Scratch; s = Scratch(); (s.path / "x").touch(); '
        'print(flush=True); input()'
    )
    with subprocess.Popen(
        [sys.executable, '-c', program], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True,
        env={**os.environ, 'TMPDIR': str(folder)},
    ) as process:  # fmt: skip
        process.stdout.readline()
        sweep()
        assert [*folder.iterdir()]
        process.send_signal(signal.SIGKILL)
    assert [*folder.iterdir()]
    sweep()
    assert not [*folder.iterdir()]


def test_every_command_sweeps(folder, capsys):
    (folder / 'sgp_scratch_left').mkdir()
    words = ['check', 'none.mcap', '--robot', 'toy_pendulum', '--out', str(folder / 'out')]
    assert main(words) == 2
    assert not [*folder.iterdir()], capsys.readouterr().err


def test_links_and_other_folders_are_left_alone(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp('other')
    (other / 'x').touch()
    (folder / 'sgp_scratch_link').symlink_to(other)
    (folder / 'sgp_kept').mkdir()
    sweep()
    assert (other / 'x').exists()
    assert len([*folder.iterdir()]) == 2
