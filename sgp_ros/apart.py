"""Reading of strangers' files in a process of its own, bounded in processor time and memory.

Large libraries in C and programs in files may crash, hang or take all memory. There they end
nothing but the reading of that file.
"""

from __future__ import annotations

import contextlib
import math
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from sgp_ros.errors import SgpError
from sgp_ros.strangers import TooMuchError, bound, readable

_SAID, _BYTES_PER_S = 1, 20e6
_PARSED_PER_S = dict.fromkeys(('.yaml', '.yml'), 0.2e6) | dict.fromkeys(
    ('.json', '.jsonl', '.ndjson'), 3e6
)
"""Bytes of text that are parsed in a second: a third of what a usual processor does."""
_BUSY = 4.0
"""Longest time over that of the processor: of a computer that does other work too."""


def read_apart(reader: str, path: Path, kind: type[SgpError], expected: str) -> bytes:
    """Return what a function writes of a file to a stream, within `SECONDS` and `UNPACKED_MB`.

    Args:
        reader: `module:function`, called with the path and the stream.
        path: of the file.
        kind: of the error where it cannot be read.
        expected: what the file should be.

    Raises:
        SgpError: of that kind, in the words of the function where it gives any.
        TooMuchError: not in time.
    """
    seconds = allowed_s(path)
    program = f'from {__name__} import write; write({reader!r}, {math.ceil(seconds)})'
    # The allocator of Arrow reserves more than it takes, which the bound of memory would count.
    environment = {**os.environ, 'ARROW_DEFAULT_MEMORY_POOL': 'system'}
    late = TooMuchError(
        f'{path} could not be read within {seconds:.0f} s', 'an intact file',
        'to allow more time, raise SGP_MOST_SECONDS',
    )  # fmt: skip
    try:
        done = subprocess.run(  # noqa: S603  # this interpreter, this package
            [sys.executable, '-c', program, str(path), expected], capture_output=True,
            timeout=_BUSY * seconds, check=False, env=environment, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise late from error
    if done.returncode == 0:
        return done.stdout
    if done.returncode == -signal.SIGXCPU:
        raise late
    said = done.stderr.decode(errors='replace').strip().splitlines()
    if done.returncode == _SAID and said:
        raise kind(said[-1])
    raise kind(
        f'{path} cannot be read: the reader stopped with status {done.returncode}', expected,
        'if this is intended, raise SGP_MOST_UNPACKED_MB and SGP_MOST_SECONDS',
    )  # fmt: skip


def allowed_s(path: Path) -> float:
    """Return how long the processor may read a file [s]: the more, the larger it is."""
    rate = _PARSED_PER_S.get(path.suffix.lower(), _BYTES_PER_S)
    return bound('SECONDS') + path.stat().st_size / rate


def write(reader: str, seconds: int) -> None:
    """Write the result of a function of a file to stdout; its exception, as one line to stderr."""
    _, path, expected = sys.argv
    most = bound('UNPACKED_MB') << 20
    for limit, value, last in (
        (resource.RLIMIT_DATA, most, most), (resource.RLIMIT_CPU, seconds, seconds + 1),
    ):  # fmt: skip
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(limit, (value, last))
    module, _, function = reader.partition(':')
    with os.fdopen(os.dup(1), 'wb') as stream:
        os.dup2(2, 1)  # what a library prints is not part of it
        try:
            with readable(path, SgpError, expected), _bounded_memory(path):
                getattr(import_module(module), function)(Path(path), stream)
        except (SgpError, OSError) as error:
            sys.exit(str(error))


@contextlib.contextmanager
def _bounded_memory(path: str) -> Iterator[None]:
    try:
        yield
    except MemoryError:
        raise TooMuchError(
            f'{path} takes too much memory', f'at most {bound("UNPACKED_MB")} MB',
            'if this is intended, raise SGP_MOST_UNPACKED_MB',
        ) from None  # fmt: skip
