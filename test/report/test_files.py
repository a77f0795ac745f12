"""Laws of result files: the old one or the new one, and one run a folder."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from sgp_ros.errors import ConfigError
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
    with pytest.raises(OSError, match='symbolic links'), replacing_results(tmp_path, 'replay'):
        pass
    assert victim.read_text() == 'mine'
