"""Result files: those of a run appear together, once all are complete, and none outlives its run.

What a run of a command wrote is listed in `.sgp_<command>.json` beside it. The next run of the
command into the same folder removes what is listed there and not written anew, such as pictures of
an earlier verdict. A file that was changed since is somebody else's and stays.

The files of a run are renamed one after the other at its end, by a process of its own, so that a
kill of the command leaves all of them new or none. What is to be renamed is noted first, in
`.sgp_<command>.moves`: where that process is cut off too, the next run completes its work.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import signal
import stat
import warnings
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

_LONGEST_NOTE = 1 << 22
"""Above this size [bytes] no note is ours."""
_LONGEST_MOVES_S = 10
"""After which a process that renames is given up."""


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, lambda stream: stream.write(content))


def write_text(path: Path, content: str) -> None:
    """Write `content` as UTF-8, as `write_bytes` does, escaping what is no text in file names."""
    write_bytes(path, content.encode('utf-8', 'backslashreplace'))


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
        _make_moves(out, command, _read(out / f'.sgp_{command}.moves'))
        remove_growing(out)
        try:
            with waiting_files(out) as waiting:
                yield
                if keeps_others:
                    _require_ours(out, command, waiting)
            with _undisturbed():
                _make_moves_apart(out, command, _note_moves(out, command, waiting))
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
        raise ConfigError(f'{path} is a link', 'a plain file', 'remove the link') from error
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


def _note_moves(out: Path, command: str, waiting: Waiting) -> dict[str, Any]:
    """Note the new names of files and which results of the last run are to go; return the note.

    Beside each name stands the mark of the file that has it now, so that a note that is found
    later reaches nothing else.
    """
    new = {path.name: _mark(growing) for path, growing in waiting.items()}
    old = _read(out / f'.sgp_{command}.json')
    content = {
        'moves': {growing.name: [path.name, _mark(path)] for path, growing in waiting.items()},
        'stale': {name: mark for name, mark in old.items() if name not in new},
        'listing': new,
    }
    write_text(out / f'.sgp_{command}.moves', json.dumps(content) + '\n')
    return content


def _make_moves(out: Path, command: str, content: dict[str, Any]) -> None:
    """Give files their names as noted; nothing where nothing is noted.

    A note may be a stranger's: of what it names only those files change that are as it says.
    """
    moves, stale, listing = (content.get(key) for key in ('moves', 'stale', 'listing'))
    if isinstance(moves, dict) and isinstance(stale, dict) and isinstance(listing, dict):
        for growing, (name, mark) in filter(_is_pair, moves.items()):
            is_ours = is_growing(growing) and _is_plain(name) and _mark(out / name) == mark
            if is_ours and listing.get(name) == _mark(out / growing) is not None:
                (out / growing).replace(out / name)
        for name, mark in stale.items():
            if _is_plain(name) and mark == _mark(out / name) is not None:
                (out / name).unlink(missing_ok=True)
        write_text(out / f'.sgp_{command}.json', json.dumps(listing, indent=1) + '\n')
    (out / f'.sgp_{command}.moves').unlink(missing_ok=True)


def _make_moves_apart(out: Path, command: str, content: dict[str, Any]) -> None:
    """Make the moves in a child that outlives this process and its group; it shares the lock.

    What it leaves, this process makes: all where no child is to be had, or what stops at an error.
    """
    with contextlib.suppress(OSError), warnings.catch_warnings():
        warnings.simplefilter('ignore', DeprecationWarning)  # the child needs no other thread
        if not (child := os.fork()):
            try:
                os.setsid()
                signal.alarm(_LONGEST_MOVES_S)
                _make_moves(out, command, content)
            finally:
                os._exit(0)
        os.waitpid(child, 0)
    if (out / f'.sgp_{command}.moves').exists():
        _make_moves(out, command, content)


def was_cut_off(out: Path) -> bool:
    """Whether a run was killed there between the names of its results; the next completes it."""
    for note in out.glob('.sgp_*.moves'):
        moves, listing = (_read(note).get(key) for key in ('moves', 'listing'))
        if isinstance(moves, dict) and isinstance(listing, dict):
            for growing, (name, _) in filter(_is_pair, moves.items()):
                found = [_mark(out / one) for one in (growing, name) if _is_plain(one)]
                if listing.get(name) is not None and listing[name] in found:
                    return True
    return False


def _is_pair(move: tuple[str, object]) -> bool:
    """Whether a noted move is to a name with a mark."""
    to = move[1]
    return isinstance(to, list) and len(to) == 2 and isinstance(to[0], str)


def _is_plain(name: object) -> bool:
    """Whether a name is that of a file in the folder itself."""
    if not isinstance(name, str) or name in {'', '..'} or '\0' in name:
        return False
    return Path(name).name == name


def _read(path: Path) -> dict[str, Any]:
    """Return the content of one of our notes; empty where there is none.

    A note is a file of our user, or of who owns its folder, and no link, pipe or device.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return {}
    with os.fdopen(handle, 'rb') as stream:
        found = os.fstat(handle)
        is_ours = found.st_uid in (os.geteuid(), path.parent.stat().st_uid)
        if not (is_ours and stat.S_ISREG(found.st_mode) and found.st_size <= _LONGEST_NOTE):
            return {}
        with contextlib.suppress(ValueError, RecursionError):
            content = json.loads(stream.read(_LONGEST_NOTE))
            return content if isinstance(content, dict) else {}
    return {}


def _mark(path: Path) -> list[int] | None:
    """Return time of change [ns] and size of a file, which no renaming changes."""
    try:
        found = path.lstat()
    except (OSError, ValueError):
        return None
    return [found.st_mtime_ns, found.st_size]
