"""Results of recordings as one table: recording x joint x parameter, in a Parquet file.

The table is a pure function of the results, so that it is the same to the byte however the results
came about. What differs from run to run, such as processor seconds, stands in a table of its own.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.optional import optional_package

COLUMNS = {
    'recording': 'string', 'start': 'time', 'duration_s': 'float64', 'robot': 'string',
    'session': 'string', 'task': 'string', 'kind': 'string', 'joint': 'string',
    'effect': 'string', 'parameter': 'string', 'value': 'float64', 'std': 'float64',
    'lower': 'float64', 'upper': 'float64', 'unit': 'string', 'text': 'string',
    'difference': 'float64', 'verdict': 'string', 'certainty': 'float64',
    'probability': 'float64', 'failure': 'string', 'versions': 'string',
}  # fmt: skip
"""Names and types of the table of results."""
RUN_COLUMNS = {
    'recording': 'string', 'task': 'string', 'processor_s': 'float64', 'wall_s': 'float64',
    'worker': 'string',
}  # fmt: skip
"""Names and types of the table of what it cost."""
_LISTS = {'setup': 'setup', 'shared': 'shared', 'findings': 'finding'}

Row = dict[str, Any]


def diagnosis_rows(content: Mapping[str, Any]) -> Iterator[Row]:
    """Yield the rows of a diagnosis: one with the verdict, then one a parameter.

    Args:
        content: of diagnosis.json.
    """
    verdict = {'verdict': content['verdict'], 'certainty': content['certainty']}
    yield {'kind': 'verdict', **verdict}
    for listed, kind in _LISTS.items():
        for f in content[listed]:
            found = {'kind': kind, 'joint': f['joint'], 'effect': f['effect'], **verdict,
                     'probability': f['probability']}  # fmt: skip
            for name, p in f['parameters'].items():
                other = f.get('difference', {}).get(name, {}).get('value')
                yield {**found, 'parameter': name, **_number(p), 'difference': other}
            if not f['parameters']:
                yield found
    for e in content['parameter_errors']:
        yield {'kind': 'body', 'joint': e['link'], 'parameter': e['parameter'], **verdict,
               **_number(e)}  # fmt: skip


def identification_rows(content: Mapping[str, Any]) -> Iterator[Row]:
    """Yield a row for each coefficient; what the motion does not determine has no number.

    Args:
        content: of identification.json.
    """
    for p in content['parameters']:
        number = _number(p) if p['std'] is not None else {'text': p['status']}
        yield {'kind': 'coefficient', 'joint': p['joint'], 'parameter': p['name'],
               **number, 'unit': p['unit']}  # fmt: skip


def _number(p: Mapping[str, Any]) -> Row:
    value, std = p['value'], p.get('std')
    if isinstance(value, str):
        return {'text': value}
    row = {'value': value, 'unit': p.get('unit', '')}
    if value is not None and std is not None:
        half = INTERVAL_95 * std
        row |= {'std': std, 'lower': value - half, 'upper': value + half}
    return row


def result_rows(results: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Return the rows of all results, in their order.

    Args:
        results: of recordings, as the command keeps them: `recording`, `start_ns`, `duration_s`,
            `robot`, `session`, `versions` and, by task, `tasks`: `rows` or `failure`.
    """
    rows = []
    for result in results:
        common = {name: result.get(name) for name in
                  ('recording', 'duration_s', 'robot', 'session', 'versions')}  # fmt: skip
        common['start'] = result.get('start_ns')
        for task, done in result['tasks'].items():
            found = done['rows'] if 'rows' in done else [
                {'kind': 'failure', 'failure': done['failure']}
            ]  # fmt: skip
            rows += [{**common, 'task': task, **row} for row in found]
    return rows


def run_rows(results: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Return what each task of each recording cost."""
    return [
        {'recording': result['recording'], 'task': task, **done.get('cost', {})}
        for result in results for task, done in result['tasks'].items()
    ]  # fmt: skip


def parquet_bytes(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> bytes:
    """Return rows as the content of a Parquet file.

    Args:
        rows: by name of column; what a row lacks is null.
        columns: names and types.

    Raises:
        ConfigError: pyarrow is missing.
    """
    require_parquet()
    arrow = optional_package('pyarrow', 'to write Parquet', 'campaign')
    parquet = optional_package('pyarrow.parquet', 'to write Parquet', 'campaign')
    types = {'string': arrow.string(), 'float64': arrow.float64(),
             'time': arrow.timestamp('ns', 'UTC')}  # fmt: skip
    schema = arrow.schema([(name, types[kind]) for name, kind in columns.items()])
    arrays = [
        arrow.array([row.get(field.name) for row in rows], field.type) for field in schema
    ]  # fmt: skip
    stream = io.BytesIO()
    parquet.write_table(arrow.Table.from_arrays(arrays, schema=schema), stream)
    return stream.getvalue()


def require_parquet() -> None:
    """Refuse, before anything is computed, to begin without the package that writes Parquet.

    Raises:
        ConfigError: pyarrow is missing.
    """
    optional_package('pyarrow.parquet', 'to write Parquet', 'campaign')
