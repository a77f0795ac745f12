"""Tables, robots, settings and models made to harm who reads them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

from sgp_proof.robustness.harmful_recordings import PIPES, Make, zeros


def long_urdf(path: Path, n: int = 5000) -> None:
    """Write a chain of n joints."""
    links = ''.join(f'<link name="l{i}"/>' for i in range(n + 1))
    joints = ''.join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for i in range(n)
    )
    path.write_text(f'<robot name="x">{links}{joints}</robot>')


def long_sdf(path: Path, n: int = 300) -> None:
    """Write n links."""
    links = ''.join(f'<link name="l{i}"/>' for i in range(n))
    joint = '<joint name="j" type="revolute"><parent>l0</parent><child>l1</child></joint>'
    path.write_text(f'<sdf version="1.9"><model name="m">{links}{joint}</model></sdf>')


def laughs(path: Path) -> None:
    """Write few aliases that stand for 43 million entries."""
    levels = [
        f'  a{i}: &a{i} {{' + ', '.join(f'k{j}: *a{i - 1}' for j in range(9)) + '}'
        for i in range(1, 9)
    ]
    path.write_text('\n'.join(['/**:', ' ros__parameters:', '  a0: &a0 {x: 1}', *levels]))


def entities(path: Path) -> None:
    """Write entities of XML that stand for a billion."""
    lines = [f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10)]
    path.write_text(f'<!DOCTYPE r [<!ENTITY a0 "ha">{"".join(lines)}]><robot name="&a9;"/>')


def xacro(path: Path, text: str) -> None:
    """Write a robot with a program in it."""
    path.write_text(f'<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}</robot>')


def _hdf5(path: Path, n: int) -> None:
    with h5py.File(path, 'w') as file:
        for name in ('t', 'q'):
            file.create_dataset(name, (n,), 'f8', compression='gzip', chunks=(1 << 20,))


def _parquet(path: Path, n: int) -> None:
    column = pa.array(np.zeros(n, dtype=np.int8))
    pq.write_table(pa.table({'t': column, 'q': column}), path, compression='zstd')


def _written(text: str) -> Make:
    return lambda path: path.write_text(text)


_YAML: dict[str, Make] = {
    'deep.yaml': _written('[' * 3000),
    'aliases.yaml': _written('a: &a [1]\nb: [' + '*a,' * 200 + ']'),
    'laughs.yaml': laughs,
    'sixty.yaml': _written('a: 1' + ':59' * 40_000),
    'circle.yaml': _written('/**:\n  ros__parameters: &p\n    a: *p\n'),
    'date.yaml': _written('a: 2001-13-45'),
    'code.yaml': _written('!!python/object/apply:os.system [exit]'),
    'large.yaml': _written('a: ' + 'x' * (17 << 20)),
    'text.yaml': lambda path: path.write_bytes(b'\xff\xfe\0\0' * 100),
    **{f'{name}.yaml': make for name, make in PIPES.items()},
}  # fmt: skip
TABLES: dict[str, Make] = {
    'twice.csv': _written('t,q,q\n1,2,3\n'), 'nul.csv': _written('t,q\n1,2\0\n'),
    'long.csv': _written('t,q\n1,' + '2' * 200_000),
    'rows.csv': _written('t,q\n' + '1,2\n' * 6_000_000),
    'cells.csv': _written(','.join(f'c{i}' for i in range(5000)) + '\n' + '\n' * 5000),
    'lists.csv': _written('t,q\n' + f'1,[{"1 " * 40_000}]\n' * 600),
    'wide_cell.csv': _written('t,q\n1,' + 'x' * 90_000 + '\n' + '1,x\n' * 100_000),
    'zip.npz': lambda path: np.savez_compressed(path, t=np.zeros(1 << 27)),
    'bytes.npz': lambda path: np.savez_compressed(path, t=np.zeros(1 << 29, dtype=np.int8)),
    'zip.mat': lambda path: savemat(path, {'t': np.zeros((1 << 24, 8))}, do_compression=True),
    'zip.h5': partial(_hdf5, n=1 << 28), 'runs.parquet': partial(_parquet, n=1 << 24),
    'deep.json': _written('[' * 3000), 'lists.json': _written('[' + '[],' * 30_000_000 + '[]]'),
    'wide.jsonl': _written(''.join(f'{{"c{i}": 1}}\n' for i in range(20_000))),
    'digits.json': _written('{"t": [' + '9' * 5000 + ']}'),
    **{f'{name}{ending}': make for ending in ('.csv', '.npz', '.mat', '.json')
       for name, make in PIPES.items()},
}  # fmt: skip
ROBOTS: dict[str, Make] = {
    **_YAML, 'long.urdf': long_urdf, 'long.sdf': long_sdf, 'entities.urdf': entities,
    'deep.urdf': _written('<robot>' + '<a>' * 3000),
    'endless.xacro': partial(xacro, text='<link name="${9**9**9}"/>'),
    'many.xml': _written('<mujoco><worldbody><replicate count="1000000"><geom size="1"/>'
                         '</replicate></worldbody></mujoco>'),
    **{f'{name}{ending}': make for ending in ('.urdf', '.xml', '.sdf', '.xacro')
       for name, make in PIPES.items()},
}  # fmt: skip
SETTINGS = _YAML
MODELS: dict[str, Make] = {
    'zip.npz': TABLES['zip.npz'], 'zeros.npz': partial(zeros, size=1 << 20),
    'objects.npz': lambda path: np.savez(path, x=np.array([{}], dtype=object)),
    **{f'{name}.npz': make for name, make in PIPES.items()},
}  # fmt: skip
TRUTHS: dict[str, Make] = {
    'deep.json': _written('[' * 3000), 'nothing.json': _written('null'),
    'large.json': _written(json.dumps('x' * (17 << 20))),
    **{f'{name}.json': make for name, make in PIPES.items()},
}  # fmt: skip


def crafted_models(model: dict[str, np.ndarray]) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Yield what is wrong with a model, and that model: each array and each entry of its text."""
    for name in (name for name in model if name != 'json'):
        x = model[name]
        wrong = {
            'complex': np.full(x.shape, np.nan + 0j), 'half': np.zeros(x.shape, np.float16),
            'text': np.full(x.shape, 'x'), 'empty': np.zeros(0), 'scalar': np.array(1.0),
            'bigger': np.zeros((7, *x.shape)), 'zeros': np.zeros_like(x), 'negative': -x,
            '1e300': np.full(x.shape, 1e300), 'short': x[: len(x) // 2] if x.ndim else x,
        }  # fmt: skip
        yield from ((f'{name} {what}', {**model, name: array}) for what, array in wrong.items())
        yield f'{name} gone', {n: array for n, array in model.items() if n != name}
    text = json.loads(str(model['json']))
    bad = (None, 'x', -1, 10**400, 1e308, math.nan, [], {}, [None], [[1]], True, 2**63)
    for key, entry in text.items():
        for value in bad:
            yield f'{key} = {value!r:.9}', model | _text_of({**text, key: value})
            for inner in entry if isinstance(entry, dict) else ():
                given = {**text, key: {**entry, inner: value}}
                yield f'{key}.{inner} = {value!r:.9}', model | _text_of(given)


def _text_of(content: dict[str, Any]) -> dict[str, np.ndarray]:
    return {'json': np.array(json.dumps(content))}
