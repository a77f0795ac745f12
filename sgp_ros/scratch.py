"""Folders of intermediate files, which the next run removes where a killed one left them.

A folder is locked as long as its process lives. So a folder that another run can lock is nobody's.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
import weakref
from contextlib import suppress
from pathlib import Path

_BEGINNING = 'sgp_scratch_'


class Scratch:
    """A folder that goes with this object, or with the process.

    Attributes:
        path: of the folder, which nobody else can read.
    """

    def __init__(self) -> None:
        sweep()
        self.path, handle = _locked_folder()
        self._finalizer = weakref.finalize(self, _remove, self.path, handle)

    def remove(self) -> None:
        """Remove the folder, where it is still there."""
        self._finalizer()

    def __enter__(self) -> Path:
        """Return the path."""
        return self.path

    def __exit__(self, *_: object) -> None:
        """Remove the folder."""
        self.remove()


def sweep() -> None:
    """Remove the folders of processes that ended without doing so; links are not followed."""
    for path in Path(tempfile.gettempdir()).glob(f'{_BEGINNING}*'):
        with suppress(OSError):  # a link, another user's, or one whose process lives
            handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.fstat(handle).st_uid == os.getuid():
                    shutil.rmtree(path, ignore_errors=True)
            finally:
                os.close(handle)


def _locked_folder() -> tuple[Path, int]:
    """Return a new folder and its lock; one that was swept before it was locked is made anew."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=_BEGINNING))
        with suppress(FileNotFoundError):
            handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            fcntl.flock(handle, fcntl.LOCK_EX)
            if path.exists():
                return path, handle
            os.close(handle)


def _remove(path: Path, handle: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(handle)
