"""Files among strangers: bounds of size, depth and count, one error for whatever reading raises.

A user who means such a file raises the bound that the message names, by an environment variable:
`SGP_MOST_TEXT_MB=64 sgp identify ...`.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

from sgp_ros.errors import SgpError

DEFAULTS = {
    'TEXT_MB': 16, 'TABLE_MB': 512, 'UNPACKED_MB': 768, 'CHUNK_MB': 256, 'RATIO': 200,
    'HELD_MB': 256, 'MESSAGES': 5_000_000, 'ROWS': 5_000_000, 'CELLS': 20_000_000,
    'DEPTH': 100, 'ENTRIES': 200_000, 'ALIASES': 100, 'LINKS': 250, 'LINE': 100_000,
    'SECONDS': 5,
}  # fmt: skip
"""Bound to its default: sizes of robot and settings files, of tables, of what a table unpacks to,
of one chunk of a recording [MB]; how many times its own size a recording unpacks to; messages of
a recording that are held at once [MB]; numbers of messages of a recording, of rows and of cells of
a table; nesting, entries and aliases of YAML or XML; links of a robot; characters of a line; time
for a file that is read in a process of its own [s]."""
_MEGABYTE = 1 << 20
_GROWING = '.sgp_growing_'
Waiting = dict[Path, Path]
"""Name in the end to the name of the complete file that waits for it."""
_WAITING: ContextVar[tuple[Path, Waiting] | None] = ContextVar('_WAITING', default=None)


GREATEST, LEAST = 1e30, 1e-30
"""Magnitudes between which numbers of models lie: what is computed of them still is a number."""


class TooMuchError(SgpError):
    """A file is beyond a bound; it may be raised by the environment."""


def bound(name: str) -> int:
    """Return a bound out of `DEFAULTS`, or what the environment has in its place."""
    given = os.environ.get(f'SGP_MOST_{name}', '')
    return int(given) if given.isdecimal() else DEFAULTS[name]


def require_within(value: float, name: str, what: str) -> None:
    """Refuse what is beyond a bound.

    Raises:
        TooMuchError: it is.
    """
    if value > bound(name):
        raise TooMuchError(
            f'{what}: {value:.6g}',
            f'at most {bound(name)}',
            f'if this is intended, raise the environment variable SGP_MOST_{name}',
        )


def require_file(path: Path, name: str = '') -> None:
    """Refuse anything but plain files, such as a pipe that never ends, and files too large.

    Args:
        path: that exists.
        name: of the bound of its size, a number of MB; empty for any size.

    Raises:
        TooMuchError: it is.
    """
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise TooMuchError(f'{path} is not a regular file', 'a file', 'copy its content to a file')
    if name:
        require_within(found.st_size / _MEGABYTE, name, f'size of {path} in MB')


def is_usable(value: object) -> bool:
    """Whether a value is a number that a model may have: of a magnitude up to `GREATEST`."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and abs(value) <= GREATEST  # type: ignore[arg-type]  # a number by now


def create_beside(path: Path) -> tuple[BinaryIO, Path]:
    """Make a new file of an unguessable name beside `path`, to be renamed once it is complete.

    It is nobody's link and no other run's file, also in a folder that everybody may write to.
    """
    prefix = f'{_GROWING}{os.getpid()}_'
    handle, name = tempfile.mkstemp(prefix=prefix, suffix=f'.{path.name}', dir=path.parent)
    mask = os.umask(0)
    os.umask(mask)
    os.fchmod(handle, 0o666 & ~mask)
    return os.fdopen(handle, 'wb'), Path(name)


def take_place(stream: BinaryIO, growing: Path, path: Path) -> None:
    """Close a complete file and give it its name; the disk has it before the name is seen.

    Inside `waiting_files` of its folder it waits for the others.
    """
    stream.flush()
    os.fsync(stream.fileno())
    stream.close()
    folder, waiting = _WAITING.get() or (None, {})
    if path.parent.absolute() != folder:
        growing.replace(path)
        return
    if path in waiting:
        waiting[path].unlink(missing_ok=True)
    waiting[path] = growing


def discard(stream: BinaryIO, growing: Path) -> None:
    """Remove a file that will not be completed, whatever the disk says to its last bytes."""
    with suppress(OSError):
        stream.close()
    growing.unlink(missing_ok=True)


def replace_file(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file under another name beside it, which it gives up once it is complete.

    Args:
        path: of the file in the end.
        write: called with the stream.
    """
    stream, growing = create_beside(path)
    try:
        write(stream)
        take_place(stream, growing, path)
    except BaseException:
        discard(stream, growing)
        raise


@contextmanager
def waiting_files(folder: Path) -> Iterator[Waiting]:
    """Yield the files of a folder that become complete inside; the caller gives them their names.

    After an error there are none.
    """
    waiting: Waiting = {}
    token = _WAITING.set((folder.absolute(), waiting))
    try:
        yield waiting
    except BaseException:
        for growing in waiting.values():
            growing.unlink(missing_ok=True)
        raise
    finally:
        _WAITING.reset(token)


def is_growing(name: str) -> bool:
    """Whether a file has a name of `create_beside`."""
    return name.startswith(_GROWING) and '/' not in name


def remove_growing(folder: Path, of: int = 0) -> None:
    """Remove what runs that were killed have left in a folder, and what process `of` has."""
    for path in folder.glob(f'{_GROWING}*'):
        process = path.name.removeprefix(_GROWING).partition('_')[0]
        if process.isdecimal() and (int(process) == of or not _is_alive(int(process))):
            path.unlink(missing_ok=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def read_text(path: Path, name: str = 'TEXT_MB') -> str:
    """Return the text of a file of settings, of a robot or of a table.

    Args:
        path: in UTF-8, with or without a mark of it.
        name: of the bound of its size.

    Raises:
        TooMuchError: no plain file, or a larger one.
        UnicodeDecodeError: no text.
    """
    require_file(path, name)
    return path.read_text(encoding='utf-8-sig')


def read_lines(path: Path, name: str, encoding: str = 'utf-8-sig') -> Iterator[str]:
    """Yield the lines of a text without their ends.

    Args:
        path: of the file.
        name: of the bound of its size.
        encoding: UTF-8, with or without a mark of it, or another one.

    Raises:
        TooMuchError: no plain file, a larger one, or a line beyond `LINE`.
        UnicodeDecodeError: no text.
    """
    require_file(path, name)
    most = bound('LINE')
    with path.open(encoding=encoding) as stream:
        while line := stream.readline(most + 2):
            text = line.removesuffix('\n')
            if len(text) > most:
                require_within(len(text), 'LINE', f'length of a line of {path}')
            yield text


@contextmanager
def readable(path: object, error: type[SgpError], expected: str) -> Iterator[None]:
    """Turn whatever the reading of a stranger's file raises into one error with one line.

    Args:
        path: of the file.
        error: the kind to raise.
        expected: what it should be.

    Raises:
        SgpError: of that kind; those raised on purpose, and errors of the disk, pass.
    """
    try:
        yield
    except (SgpError, OSError):
        raise
    except Exception as problem:
        text = ' '.join(f'{type(problem).__name__}: {problem}'.split())[:200]
        raise error(f'{path} cannot be read ({text})', expected) from problem
