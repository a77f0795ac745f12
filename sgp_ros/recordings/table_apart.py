"""Columns of MAT, HDF5 and Parquet files, read in a process of its own.

These formats are read by large libraries in C, which a damaged file may end, hang or make take all
memory. The process has bounds of time and memory, and sends arrays back, no objects.
"""

from __future__ import annotations

import contextlib
import io
import os
import resource
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.recordings.table_formats import load_hdf5, load_parquet
from sgp_ros.strangers import TooMuchError, bound, readable

Columns = dict[str, np.ndarray]

_SAID, _BYTES_PER_S = 1, 20e6
_NAMES = 'names'
_KINDS = 'a MATLAB .mat, an HDF5 or a Parquet file'


def load_apart(path: Path) -> Columns:
    """Return the arrays of a file with an ending of `READERS` by name.

    Raises:
        RecordingError: it cannot be read.
        TooMuchError: not in time.
    """
    program = f'from {__name__} import send; import sys; send(sys.argv[1])'
    seconds = bound('SECONDS') + path.stat().st_size / _BYTES_PER_S
    # The allocator of Arrow reserves more than it takes, which the bound of memory would count.
    environment = {**os.environ, 'ARROW_DEFAULT_MEMORY_POOL': 'system'}
    try:
        done = subprocess.run(  # noqa: S603  # this interpreter, this package
            [sys.executable, '-c', program, str(path)], capture_output=True, timeout=seconds,
            check=False, env=environment,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise TooMuchError(
            f'{path} could not be read within {seconds:.0f} s', 'an intact file',
            'to allow more time, raise SGP_MOST_SECONDS',
        ) from error  # fmt: skip
    if done.returncode == 0:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            return {str(name): arrays[f'c{i}'] for i, name in enumerate(arrays[_NAMES])}
    said = done.stderr.decode(errors='replace').strip().splitlines()
    if done.returncode == _SAID and said:
        raise RecordingError(said[-1])
    raise RecordingError(
        f'{path} cannot be read: the reader stopped with status {done.returncode}', _KINDS,
        'save it again, or as CSV',
    )  # fmt: skip


def send(path: str) -> None:
    """Write the arrays of a file to stdout as NPZ, within the bound of what it unpacks to."""
    most = 2 * bound('UNPACKED_MB') * (1 << 20)
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    try:
        with readable(path, RecordingError, _KINDS):
            columns = READERS[Path(path).suffix.lower()](Path(path))
    except SgpError as error:
        sys.exit(str(error))
    arrays = {f'c{i}': array for i, array in enumerate(columns.values())}
    arrays[_NAMES] = np.array([*columns], dtype=str)
    with open(1, 'wb', closefd=False) as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def _load_mat(path: Path) -> Columns:
    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:  # version 7.3
        return load_hdf5(path, is_matlab=True)
    except (MatReadError, ValueError, TypeError, KeyError, IndexError, zlib.error) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a MATLAB .mat file') from error
    return dict(_flattened('', content))


def _flattened(prefix: str, content: Mapping[str, object]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of nested structures and cells under dotted names.

    A cell array of vectors of one length is a matrix, one row a cell; each cell also has its own
    name, `data.0` and so on, and so have the elements of an array of structures.
    """
    for name, value in content.items():
        place = prefix + name
        if isinstance(value, dict):
            yield from _flattened(f'{place}.', value)
        elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
            cells = list(np.asarray(value, dtype=object).ravel()) if len(value) else []
            yield from _flattened(f'{place}.', {str(i): cell for i, cell in enumerate(cells)})
            arrays = [np.atleast_1d(np.asarray(c)) for c in cells if not isinstance(c, dict)]
            if len(arrays) == len(cells) > 0 and len({a.shape for a in arrays}) == 1:
                stacked = np.array(arrays)
                if stacked.ndim == 2 and stacked.dtype.kind in 'fiub':
                    yield place, stacked
        elif isinstance(value, np.ndarray) and value.ndim and value.dtype.kind in 'fiub':
            yield place, value


READERS: dict[str, Callable[[Path], Columns]] = {
    '.mat': _load_mat,
    **dict.fromkeys(('.h5', '.hdf5', '.hdf'), load_hdf5),
    **dict.fromkeys(('.parquet', '.pq'), load_parquet),
}
"""Ending to what reads such a file."""
