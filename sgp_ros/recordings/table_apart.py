"""Columns of MAT, HDF5, Parquet, JSON and YAML files, read in a process of its own.

It sends arrays back, no objects.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from sgp_ros.apart import read_apart
from sgp_ros.errors import RecordingError
from sgp_ros.recordings.table_formats import load_hdf5, load_json, load_messages, load_parquet
from sgp_ros.strangers import require_within

Columns = dict[str, np.ndarray]

_NAMES, _REMARKS = 'names', 'remarks'
_KINDS = 'a MATLAB .mat, an HDF5, a Parquet, a JSON or a YAML file'
_COPIES = 3
"""Of what is sent, while it is: packed, received and as arrays."""


def load_apart(path: Path, remarks: list[str]) -> Columns:
    """Return the arrays of a file with an ending of `READERS` by name.

    Args:
        path: of the file.
        remarks: what is left out of it is appended here.

    Raises:
        RecordingError: it cannot be read.
        TooMuchError: not in time.
    """
    data = read_apart(f'{__name__}:write_columns', path, RecordingError, _KINDS)
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        remarks += [str(said) for said in arrays[_REMARKS]]
        return {str(name): arrays[f'c{i}'] for i, name in enumerate(arrays[_NAMES])}


def write_columns(path: Path, stream: BinaryIO) -> None:
    """Write the arrays of a file as NPZ."""
    remarks: list[str] = []
    columns = READERS[path.suffix.lower()](path, remarks)
    require_bounded(path, columns)
    megabytes = _COPIES * sum(array.nbytes for array in columns.values()) / (1 << 20)
    require_within(megabytes, 'UNPACKED_MB', f'size of the table {path} in MB')
    arrays = {f'c{i}': array for i, array in enumerate(columns.values())}
    arrays[_NAMES] = np.array([*columns], dtype=str)
    arrays[_REMARKS] = np.array(remarks, dtype=str)
    np.savez(stream, allow_pickle=False, **arrays)


def require_bounded(path: Path, columns: Columns) -> None:
    """Refuse a table of too many numbers.

    Raises:
        TooMuchError: more than `ROWS` or `CELLS`.
    """
    rows = max((len(array) for array in columns.values()), default=0)
    require_within(rows, 'ROWS', f'number of rows of {path}')
    cells = sum(array.size for array in columns.values())
    require_within(cells, 'CELLS', f'number of cells of {path}')


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
            if cells and all(isinstance(c, str) for c in cells):
                yield place, np.array(cells)
        elif isinstance(value, np.ndarray) and value.ndim and value.dtype.kind in 'fiubU':
            yield place, value


READERS: dict[str, Callable[[Path, list[str]], Columns]] = {
    '.mat': lambda path, _: _load_mat(path),
    **dict.fromkeys(('.h5', '.hdf5', '.hdf'), lambda path, _: load_hdf5(path)),
    **dict.fromkeys(('.parquet', '.pq'), lambda path, _: load_parquet(path)),
    **dict.fromkeys(('.json', '.jsonl', '.ndjson'), load_json),
    **dict.fromkeys(('.yaml', '.yml'), lambda path, _: load_messages(path)),
}
"""Ending to what reads such a file, and appends what is left out of it."""
