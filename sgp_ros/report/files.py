"""Result files: each appears under its name only when it is complete, and none outlives its run.

What a run of a command wrote is listed in `.sgp_<command>.json` beside it. The next run of the
command into the same folder removes what is listed there and not written anew, such as pictures of
an earlier verdict. A file that was changed since is somebody else's and stays.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path

from sgp_ros.errors import ConfigError
from sgp_ros.strangers import create_beside, remove_growing, take_place


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    stream, growing = create_beside(path)
    try:
        stream.write(content)
        take_place(stream, growing, path)
    except BaseException:
        stream.close()
        growing.unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """Write `content` as UTF-8, as `write_bytes` does."""
    write_bytes(path, content.encode('utf-8'))


@contextlib.contextmanager
def replacing_results(out: Path, command: str) -> Iterator[None]:
    """Let the results that are written inside take the place of those of the last run.

    After an error nothing is removed. Two runs into one folder would mix their results, so the
    second one is refused; the lock ends with its process, however that ends.

    Args:
        out: folder of the results, which is made.
        command: whose results they are; those of other commands stay.

    Raises:
        ConfigError: another run writes there.
    """
    out.mkdir(parents=True, exist_ok=True)
    with _locked(out / f'.sgp_{command}.lock'):
        remove_growing(out)
        with _listing_results(out, command):
            yield


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
    handle = os.open(path, flags, 0o644)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            who = os.pread(handle, 200, 0).decode(errors='replace').strip() or 'unknown'
            raise ConfigError(
                f'{path.parent} is being written to by another run ({who})',
                'a folder of its own for each', 'choose another one with --out, or wait',
            ) from error  # fmt: skip
        os.ftruncate(handle, 0)
        os.pwrite(handle, f'process {os.getpid()}\n'.encode(), 0)
        yield
        path.unlink(missing_ok=True)
    finally:
        os.close(handle)


@contextlib.contextmanager
def _listing_results(out: Path, command: str) -> Iterator[None]:
    listing = out / f'.sgp_{command}.json'
    before = _marks(out)
    yield
    after = _marks(out)
    with contextlib.suppress(OSError, ValueError, AttributeError):  # no listing, or none of ours
        for name, mark in json.loads(listing.read_text(encoding='utf-8')).items():
            if after.get(name) == mark == before.get(name):
                (out / name).unlink()
    written = {name: mark for name, mark in after.items() if before.get(name) != mark}
    write_text(listing, json.dumps(written, indent=1) + '\n')


def _marks(folder: Path) -> dict[str, list[int]]:
    """Return time of change [ns] and size of every file in a folder, folders in it left out."""
    stats = {
        path.name: path.stat()
        for path in folder.iterdir()
        if path.is_file() and path.suffix != '.lock'
    }
    return {name: [found.st_mtime_ns, found.st_size] for name, found in stats.items()}
