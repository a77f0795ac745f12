"""Columns of Parquet, HDF5, JSON and YAML files by name, and the formats that are refused."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.errors import RecordingError
from sgp_ros.markup import YAMLError, load_yaml
from sgp_ros.optional import optional_package
from sgp_ros.recordings.column_names import meaning
from sgp_ros.strangers import read_text, require_within

Columns = dict[str, np.ndarray]

_PROGRAM = 'pickle files can run code when they are read, so they are not accepted'
REFUSED = {
    **dict.fromkeys(('.pkl', '.pickle', '.pt', '.pth', '.joblib', '.p'), _PROGRAM),
    '.zarr': 'zarr stores are not supported',
    '.npy': 'an .npy array has no column names',
    '.xlsx': 'spreadsheets are not supported',
}
"""Ending to the reason why such a file is not read."""
_LISTED = 12
"""Keys without numbers of rows that are listed by name."""
_REMEDY = 'save the data with numpy.savez, as CSV or as Parquet'


def refuse(path: Path) -> None:
    """Refuse a file that is never read.

    Raises:
        RecordingError: it is one of `REFUSED`.
    """
    reason = REFUSED.get(path.suffix.lower())
    if reason is not None:
        raise RecordingError(f'{path.name}: {reason}', 'a table of numbers', _REMEDY)


def load_parquet(path: Path) -> Columns:
    """Return the columns of a Parquet file; lists of one length are matrices.

    Times and durations become numbers, `timestamp [ns]`.

    Raises:
        RecordingError: a damaged file.
        ConfigError: pyarrow is missing.
    """
    parquet = optional_package('pyarrow.parquet', 'to read Parquet', 'tables')
    try:
        table = parquet.read_table(str(path), use_threads=False)
    except Exception as error:  # the library has its own errors
        raise RecordingError(
            f'{path.name} cannot be read ({" ".join(str(error).split())})', 'a Parquet file'
        ) from error
    columns: Columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = re.match(r'(timestamp|duration)\[(\w+)', str(column.type))
        if kind is None:
            _enter(columns, name, column.to_pylist())
        else:
            _enter(columns, f'{name} [{kind[2]}]', column.cast('int64').to_pylist())
    return columns


def feature_names(path: Path) -> dict[str, list[str]]:
    """Return what LeRobot's `meta/info.json` above a file calls the parts of its columns."""
    for folder in path.resolve().parents[:5]:
        info = folder / 'meta' / 'info.json'
        if not info.is_file():
            continue
        try:
            features = json.loads(read_text(info)).get('features', {})
        except (OSError, ValueError, AttributeError):
            return {}
        found = {}
        for column, said in features.items() if isinstance(features, dict) else ():
            names = said.get('names') if isinstance(said, dict) else None
            if isinstance(names, dict):
                names = next((x for x in names.values() if isinstance(x, list)), None)
            if isinstance(names, list) and all(isinstance(n, str) for n in names):
                found[str(column)] = names
        return found
    return {}


def load_hdf5(path: Path, *, is_matlab: bool = False) -> Columns:
    """Return the datasets of an HDF5 file under dotted names.

    A unit that only the attributes of a dataset state follows its name: `axis.torque [kN m]`.

    Args:
        path: of the file.
        is_matlab: MATLAB writes the axes of an array in reverse order.

    Raises:
        RecordingError: a damaged file.
        ConfigError: h5py is missing.
    """
    h5py = optional_package('h5py', 'to read HDF5', 'tables')
    columns: Columns = {}

    def enter(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or not item.shape:
            return
        name = name.replace('/', '.')
        units = (item.attrs.get(x) for x in ('unit', 'units', 'Unit', 'Units'))
        unit = next((u for u in units if isinstance(u, str) and u.strip()), '')
        if unit and not meaning(name).unit:
            name = f'{name} [{unit.strip()}]'
        if h5py.check_string_dtype(item.dtype) is not None:
            columns[name] = np.array(item.asstr(errors='replace')[()], dtype=str)
        elif item.dtype.kind in 'fiub':
            array = np.asarray(item[()])
            array = array.T if is_matlab else array
            flat = array.ravel() if array.ndim == 2 and 1 in array.shape else array
            columns[name] = flat

    try:
        with h5py.File(path, 'r') as file:
            file.visititems(enter)
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise RecordingError(
            f'{path.name} cannot be read ({" ".join(str(error).split())})', 'an HDF5 file'
        ) from error
    return columns


def load_json(path: Path, remarks: list[str]) -> Columns:
    """Return the columns of a JSON file: of a mapping to lists, or of a list of records.

    In `.jsonl` and `.ndjson` each line is a record. Lists of records below several keys have the
    key before the names of their columns.

    Args:
        path: of the file.
        remarks: the key that is read, and those that are left out, are appended here.

    Raises:
        RecordingError: no JSON, or no table.
    """
    try:
        text = read_text(path, 'TABLE_MB')
        if path.suffix.lower() == '.json':
            content = json.loads(text)
        else:
            content = [json.loads(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError) as error:
        raise RecordingError(
            f'{path.name} is not JSON ({error})', 'JSON, or JSON Lines with one record per line'
        ) from None
    columns: Columns = {}
    if isinstance(content, list) and content and all(isinstance(x, dict) for x in content):
        columns = _of_records(path, _alike([dict(_flattened('', x)) for x in content]))
    elif isinstance(content, dict):
        columns = _of_object(path, content, remarks)
    if not columns:
        raise RecordingError(
            f'{path.name} contains no table',
            'an object of lists, or a list of records, or one of them below a key',
        )
    return columns


def _of_object(path: Path, content: Mapping[str, Any], remarks: list[str]) -> Columns:
    """Return the columns of lists, or of lists of records where the longest list is one."""
    flat = dict(_flattened('', content))
    lists = {name: x for name, x in flat.items() if isinstance(x, list) and x}
    tables = {name: x for name, x in lists.items() if all(isinstance(y, dict) for y in x)}
    if not lists or max(lists, key=lambda n: len(lists[n])) not in tables:
        tables = {}
    columns: Columns = {}
    for name, records in tables.items():
        found = _of_records(path, _alike([dict(_flattened('', x)) for x in records]))
        before = f'{name.replace(".", "_")}.' if len(tables) > 1 else ''
        columns |= {f'{before}{n}': x for n, x in found.items()}
    for name, values in () if tables else lists.items():
        _enter(columns, name, values)
    used = {*tables} or {*columns}
    left = [name for name in flat if name not in used]
    if columns and left:
        read = f'the list of records {" and ".join(tables)} is read; ' * bool(tables)
        more = f' and {len(left) - _LISTED} more' if len(left) > _LISTED else ''
        remarks.append(f'{path.name}: {read}{", ".join(left[:_LISTED])}{more} not read')
    return columns


def load_messages(path: Path) -> Columns:
    """Return the columns of messages between lines `---`, as `ros2 topic echo` prints them.

    A message that is cut off, or another text between them, is a row without numbers in its lists.

    Raises:
        RecordingError: not even half of them are messages of one kind.
    """
    texts = re.split(r'(?m)^---\s*$', read_text(path, 'TABLE_MB'))
    records = [_message(text) for text in texts if text.strip()]
    shapes = [_shape(r) for r in records]
    usual = max(shapes, key=len, default={})
    if not usual or 2 * shapes.count(usual) < len(records):
        raise RecordingError(
            f'{path.name} is no stream of messages',
            'what `ros2 topic echo` of a sensor_msgs/JointState prints',
        )
    found = [r if s == usual else {} for r, s in zip(records, shapes, strict=True)]
    return _of_records(path, _alike(found))


def _message(text: str) -> dict[str, Any]:
    try:
        content = load_yaml(text)
    except YAMLError:
        return {}
    return dict(_flattened('', content)) if isinstance(content, dict) else {}


def _shape(record: Mapping[str, Any]) -> dict[str, int]:
    """Return the lengths of the lists of a record, -1 for what is none."""
    return {n: len(x) if isinstance(x, list) else -1 for n, x in record.items()}


def _alike(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return records, those without a list of the usual one without numbers in its lists.

    Such are headers, and messages between the states.
    """
    kinds = Counter(frozenset(_shape(r).items()) for r in records)
    usual = dict(kinds.most_common(1)[0][0])
    lists = [n for n, size in usual.items() if size >= 0]
    if not lists:
        return records
    first = next(r for r in records if _shape(r) == usual)
    empty = {n: None if n in lists else x for n, x in first.items()}
    return [
        r if any(isinstance(r.get(n), list) for n in lists)
        else empty | {n: r[n] for n in usual if n in r and n not in lists}
        for r in records
    ]  # fmt: skip


def _of_records(path: Path, records: list[dict[str, Any]]) -> Columns:
    columns: Columns = {}
    names = dict.fromkeys(name for record in records for name in record)
    megabytes = 8e-6 * len(records) * len(names)
    require_within(megabytes, 'UNPACKED_MB', f'size of the table {path} in MB')
    for name in names:
        _enter(columns, name, [record.get(name) for record in records])
    return columns


def _flattened(prefix: str, content: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flattened(f'{prefix}{name}.', value)
        else:
            yield f'{prefix}{name}', value


def _enter(columns: Columns, name: str, values: list[Any]) -> None:
    """Enter a column of numbers, texts or lists of numbers; others are left out."""
    if all(isinstance(x, list) for x in values if x is not None):
        lengths = {len(x) for x in values if x is not None}
        if len(lengths) != 1:
            return
        none = [None] * lengths.pop()
        values = [none if x is None else x for x in values]
        rows = [[np.nan if y is None else y for y in x] for x in values]
        if rows[0] and all(isinstance(y, str) for x in rows for y in x):
            columns[name] = np.array(rows)
        elif all(isinstance(y, int | float) for x in rows for y in x):
            columns[name] = np.array(rows, dtype=np.float64)
    elif all(isinstance(x, int) for x in values):
        columns[name] = np.array(values)
    elif all(x is None or isinstance(x, int | float) for x in values):
        columns[name] = np.array([np.nan if x is None else float(x) for x in values])
    elif all(isinstance(x, str) for x in values):
        columns[name] = np.array(values)
