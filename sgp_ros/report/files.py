"""Result files: each appears under its name only when it is complete, and none outlives its run.

What a run of a command wrote is listed in `.sgp_<command>.json` beside it. The next run of the
command into the same folder removes what is listed there and not written anew, such as pictures of
an earlier verdict. A file that was changed since is somebody else's and stays.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    growing = path.with_name(f'{path.name}.part')
    try:
        growing.write_bytes(content)
        os.replace(growing, path)  # noqa: PTH105 - atomic, also over an existing file
    except BaseException:
        growing.unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """Write `content` as UTF-8, as `write_bytes` does."""
    write_bytes(path, content.encode('utf-8'))


@contextlib.contextmanager
def replacing_results(out: Path, command: str) -> Iterator[None]:
    """Let the results that are written inside take the place of those of the last run.

    After an error nothing is removed.

    Args:
        out: folder of the results, which is made.
        command: whose results they are; those of other commands stay.
    """
    out.mkdir(parents=True, exist_ok=True)
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
    stats = {path.name: path.stat() for path in folder.iterdir() if path.is_file()}
    return {name: [found.st_mtime_ns, found.st_size] for name, found in stats.items()}
