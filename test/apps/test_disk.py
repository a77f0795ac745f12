"""A disk that is full and a folder that nobody may write to: one line, status 2, nothing left."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

READ_ONLY = Path('/sys')
"""Even root makes no folder there."""


def _run(arguments, most_bytes=None):
    """Run a command that may write no file beyond so many bytes, as if the disk were full."""

    def limit():
        if most_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))

    return subprocess.run(
        [sys.executable, '-B', '-m', 'sgp_ros.cli', *map(str, arguments)], preexec_fn=limit,
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def _table(folder):
    path = folder / 'log.csv'
    path.write_text('t,q\n' + ''.join(f'{0.01 * i},{0.1 * i}\n' for i in range(400)))
    return path


def _commands(folder):
    return {
        'simulate': ['simulate', 'toy_pendulum', '--duration', '2'],
        'import': ['import', _table(folder)],
        'effects': ['effects'],
    }


@pytest.mark.parametrize(
    ('name', 'most_bytes'),
    [('simulate', 1500), ('import', 1000), ('effects', 100)],
)
def test_a_full_disk_ends_a_command_with_one_line(tmp_path, name, most_bytes):
    out = tmp_path / 'out'
    out.mkdir()
    (out / '.sgp_x.json').write_text('{}')
    done = _run([*_commands(tmp_path)[name], '--out', out], most_bytes)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count('\n') == 1
    assert 'File too large' in done.stderr
    assert not [path.name for path in out.iterdir() if 'growing' in path.name]
    assert not [path.name for path in out.iterdir() if path.stat().st_size >= most_bytes]


@pytest.mark.skipif(not READ_ONLY.is_dir(), reason='needs the folder /sys of Linux')
@pytest.mark.parametrize('name', ['import', 'effects'])
def test_a_folder_that_may_not_be_written_is_said(tmp_path, name):
    done = _run([*_commands(tmp_path)[name], '--out', READ_ONLY / 'sgp_results'])
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert str(READ_ONLY) in done.stderr
