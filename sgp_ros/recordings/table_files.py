"""Columns of table files by name."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.recordings.column_names import TIME, meaning
from sgp_ros.recordings.model_files import require_unpacked
from sgp_ros.recordings.table_apart import READERS, load_apart, require_bounded
from sgp_ros.recordings.table_folder import load_folder
from sgp_ros.recordings.table_formats import refuse
from sgp_ros.recordings.table_text import load_text
from sgp_ros.recordings.table_units import as_numbers
from sgp_ros.strangers import readable, require_file

Columns = dict[str, np.ndarray]
_SECONDS = {
    'sec': ('nanosec', 'nsec'), 'secs': ('nsecs', 'nanosecs'), 'seconds': ('nanoseconds',),
}  # fmt: skip
"""Ends of the names of a ROS stamp's two parts."""
ENDINGS = (
    '.csv', '.tsv', '.txt', '.dat', '.npz', '.mat', '.h5', '.hdf5', '.parquet', '.json', '.jsonl',
    '.yaml',
)  # fmt: skip
"""Of files that are read."""
_PACKED = {'.gz', '.bz2', '.xz', '.zst', '.zip', '.tar', '.tgz', '.7z'}


def load_columns(path: Path, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    """Return the arrays of a table file by name, and the line of each row; empty without lines.

    Times of a CSV file that a float cannot hold stay texts.

    Args:
        path: with one of `ENDINGS`, of text, the first row names the columns; or a folder of
            tables, see `table_folder`.
        remarks: what is left out of it is appended here.

    Raises:
        RecordingError: no such file, another format, or a damaged one.
        TooMuchError: more than `ROWS` or `CELLS`, or beyond another bound.
    """
    refuse(path)
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        columns = load_folder(path, lambda file: load_columns(file, remarks)[0], remarks)
        require_bounded(path, columns)
        return columns, ()
    if not path.is_file():
        raise RecordingError(f'no table at {path}', 'a CSV, NPZ or MAT file', 'check the path')
    require_file(path, 'TABLE_MB')
    with readable(path, RecordingError, f'one of {", ".join(ENDINGS)}'):
        columns, lines = _load(path, path.suffix.lower(), remarks)
        columns = _in_one_order(_with_whole_stamps(columns))
        require_bounded(path, columns)
        return columns, lines


def _load(path: Path, suffix: str, remarks: list[str]) -> tuple[Columns, Sequence[int]]:
    if suffix == '.npz':
        return _load_npz(path, remarks), ()
    if suffix in READERS:
        return load_apart(path, remarks), ()
    if suffix in {'.csv', '.tsv', '.txt', '.dat'}:
        return load_text(path, remarks)
    raise RecordingError(
        f'{path} has the file type {suffix!r}', f'one of {", ".join(ENDINGS)}',
        'unpack it first' if suffix in _PACKED else '',
    )  # fmt: skip


def _with_whole_stamps(columns: Columns) -> Columns:
    """Return a table in which seconds and nanoseconds of a ROS stamp are one column of texts.

    `header.stamp.sec` and `header.stamp.nanosec` become `header.stamp`, with all its decimals.
    """
    found = dict(columns)
    for name, seconds in columns.items():
        end = re.split(r'[^A-Za-z]', name)[-1]
        head = name.removesuffix(end)
        for other in _SECONDS.get(end.lower(), ()):
            rest = next((x for x in columns if x.lower() == f'{head}{other}'.lower()), None)
            if rest is None:
                continue
            a, b = as_numbers(seconds), as_numbers(columns[rest])
            if a is None or b is None or a.ndim != 1 or a.shape != b.shape:
                continue
            if np.isfinite(a).all() and (a % 1 == 0).all() and ((b >= 0) & (b < 1e9)).all():
                texts = [f'{s:.0f}.{n:09.0f}' for s, n in zip(a, b, strict=True)]
                whole = head.rstrip('._/ ')
                whole = whole if meaning(whole).role == TIME else f'{head}stamp'
                found = {k: x for k, x in found.items() if k not in {name, rest}}
                found[whole] = np.array(texts)
    return found


def _in_one_order(columns: Columns) -> Columns:
    """Return a table in which names of joints that each row repeats stand once.

    Lists of numbers beside them, such as `position` beside `name`, follow the order of the first
    row. Names that differ between rows in more than their order are left out.
    """
    found = dict(columns)
    for name, texts in columns.items():
        if texts.ndim != 2 or texts.dtype.kind != 'U':
            continue
        del found[name]
        order = np.argsort(texts, axis=1)
        is_permuted = (np.take_along_axis(texts, order, 1) == np.sort(texts[0])).all()
        if not is_permuted or len(set(texts[0])) != texts.shape[1]:
            continue
        found[name] = texts[0]
        if (texts != texts[0]).any():
            at = order[:, np.argsort(order[0])]
            for other, x in columns.items():
                is_beside = other.rpartition('.')[0] == name.rpartition('.')[0]
                if is_beside and x.shape == texts.shape and x.dtype.kind in 'fiu':
                    found[other] = np.take_along_axis(x, at, 1)
    return found


def _load_npz(path: Path, remarks: list[str]) -> Columns:
    try:
        require_unpacked(path)
        with np.load(path, allow_pickle=False) as content:
            columns = dict(_plain_arrays(content))
            left = [name for name in content.files if name not in columns]
    except (ValueError, OSError, zipfile.BadZipFile, EOFError, AttributeError) as error:
        raise RecordingError(f'{path} cannot be read ({error})', 'a NumPy .npz file') from error
    if left:
        remarks.append(f'{path.name}: {left} contain Python objects and are not read')
    return columns


def _plain_arrays(content: np.lib.npyio.NpzFile) -> Iterator[tuple[str, np.ndarray]]:
    """Yield all arrays but those of Python objects, which would need pickle."""
    for name in content.files:
        try:
            array = content[name]
        except ValueError as error:
            if 'allow_pickle' not in str(error):
                raise
            continue
        yield name, np.atleast_1d(array)
