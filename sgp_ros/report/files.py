"""Result files: those of a run appear together, once all are complete, and none outlives its run.

What a run of a command wrote is listed in `.sgp_<command>.json` beside it. The next run of the
command into the same folder removes what is listed there and not written anew, such as pictures of
an earlier verdict. A file that was changed since is somebody else's and stays.

The files of a run are renamed one after the other at its end. What is to be renamed is noted
first, in `.sgp_<command>.moves`, so that the next run completes what a kill cuts off there.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sgp_ros.errors import ConfigError
from sgp_ros.strangers import (
    Waiting,
    is_growing,
    remove_growing,
    replace_file,
    waiting_files,
)


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, lambda stream: stream.write(content))


def write_text(path: Path, content: str) -> None:
    """Write `content` as UTF-8, as `write_bytes` does."""
    write_bytes(path, content.encode('utf-8'))


@contextlib.contextmanager
def replacing_results(out: Path, command: str, *, keeps_others: bool = False) -> Iterator[None]:
    """Let the results that are written inside take the place of those of the last run.

    After an error or a kill those are as they were. Two runs into one folder would mix their
    results, so the second one is refused; the lock ends with its process, however that ends.

    Args:
        out: folder of the results, which is made.
        command: whose results they are; those of other commands stay.
        keeps_others: whether a file that the last run did not write, or that was changed since,
            is an error instead of being replaced.

    Raises:
        ConfigError: another run writes there, or somebody else's file is in the way.
    """
    out.mkdir(parents=True, exist_ok=True)
    with _locked(out / f'.sgp_{command}.lock'):
        _make_moves(out, command)
        remove_growing(out)
        try:
            with waiting_files(out) as waiting:
                yield
                if keeps_others:
                    _require_ours(out, command, waiting)
            with _undisturbed():
                _note_moves(out, command, waiting)
                _make_moves(out, command)
        except BaseException:  # a signal may come between the making of a file and its care
            if not (out / f'.sgp_{command}.moves').exists():
                remove_growing(out, of=os.getpid())
            raise


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    while (handle := _lock(path)) is None:
        pass
    try:
        os.ftruncate(handle, 0)
        os.pwrite(handle, f'process {os.getpid()}\n'.encode(), 0)
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _lock(path: Path) -> int | None:
    """Return the open lock file; None where the run before removed it in between."""
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise ConfigError(f'{path} is a link', 'no link there', 'remove it') from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        who = os.pread(handle, 200, 0).decode(errors='replace').strip() or 'unknown'
        os.close(handle)
        raise ConfigError(
            f'{path.parent} is being written to by another run ({who})',
            'a folder of its own for each', 'choose another one with --out, or wait',
        ) from error  # fmt: skip
    with contextlib.suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(handle), path.lstat()):
            return handle
    os.close(handle)
    return None


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Let signals that end a run wait."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _require_ours(out: Path, command: str, waiting: Waiting) -> None:
    listing = _read(out / f'.sgp_{command}.json')
    for path in waiting:
        mark = _mark(path)
        if mark is not None and listing.get(path.name) != mark:
            raise ConfigError(
                f'{path} exists, and the last run did not write it or it was changed since',
                'a new name', 'rename it, choose another --out, or add --force',
            )  # fmt: skip


def _note_moves(out: Path, command: str, waiting: Waiting) -> None:
    """Note the new names of files, and which results of the last run are to go."""
    new = {path.name: _mark(growing) for path, growing in waiting.items()}
    old = _read(out / f'.sgp_{command}.json')
    content = {
        'moves': {growing.name: path.name for path, growing in waiting.items()},
        'stale': [
            name for name, mark in old.items() if name not in new and _mark(out / name) == mark
        ],
        'listing': new,
    }
    write_text(out / f'.sgp_{command}.moves', json.dumps(content) + '\n')


def _make_moves(out: Path, command: str) -> None:
    """Give files their names as noted; nothing where nothing is noted."""
    note = out / f'.sgp_{command}.moves'
    content = _read(note)
    moves, stale, listing = (content.get(key) for key in ('moves', 'stale', 'listing'))
    if isinstance(moves, dict) and isinstance(stale, list):
        for growing, name in moves.items():
            if is_growing(growing) and _is_plain(name) and (out / growing).exists():
                (out / growing).replace(out / name)
        for name in filter(_is_plain, stale):
            (out / name).unlink(missing_ok=True)
        write_text(out / f'.sgp_{command}.json', json.dumps(listing, indent=1) + '\n')
    note.unlink(missing_ok=True)


def _is_plain(name: object) -> bool:
    """Whether a name is that of a file in the folder itself."""
    return isinstance(name, str) and Path(name).name == name


def _read(path: Path) -> dict[str, Any]:
    """Return the content of one of our notes; empty where there is none."""
    with contextlib.suppress(OSError, ValueError):
        content = json.loads(path.read_text(encoding='utf-8'))
        return content if isinstance(content, dict) else {}
    return {}


def _mark(path: Path) -> list[int] | None:
    """Return time of change [ns] and size of a file, which no renaming changes."""
    try:
        found = path.lstat()
    except OSError:
        return None
    return [found.st_mtime_ns, found.st_size]
