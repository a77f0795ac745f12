"""Damaged files by seed: one line and status 2, or an answer; no traceback, no hang, no crash.

    python -m sgp_proof.robustness.files --seeds 0:1000

Each seed takes a real file of one format, damages it (bytes flipped, cut, zeroed, repeated, put
in; numbers made large) and has it read as the commands do. Recordings that can be read go through
`check`, `replay` and `identify`, odd ones that are intact too; models with wrong content and a
right hash are given a stream. Everything that is no `SgpError` or
`OSError` is a fault; so are fewer messages than stated without a remark in each result, more than
ten seconds to read a file, and one gibibyte.
"""

from __future__ import annotations

import json
import os
import resource
import sqlite3
import tempfile
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

from sgp_proof.result_files import ROOT, make_parser, read_result, seed_range, write_result
from sgp_proof.robustness.events import LONGEST_S, MOST_KILOBYTES, Faults, place_of
from sgp_proof.robustness.read_bags import faults_of_commands, read_bag, states, write_odd
from sgp_proof.robustness.read_models import taught, use_model, write_crafted
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.engine import Engine
from sgp_ros.engine.snapshots import restored, take_snapshot
from sgp_ros.errors import SgpError
from sgp_ros.recordings.model_files import load_model, load_parameters, save_model
from sgp_ros.recordings.reader import open_recording
from sgp_ros.recordings.table_files import load_columns
from sgp_ros.recordings.table_map import read_map
from sgp_ros.recordings.tables import read_table
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.robots.registry import load_robot

N, STATES = 60, 200
"""Rows of tables, states of recordings."""
BAGS = ('mcap', 'db3', 'bag', 'odd')
MAP = {
    'time': {'column': 't', 'unit': 's'},
    'joints': {'hinge': {'position': {'column': 'q', 'unit': 'rad'}}},
}
MJCF = (
    '<mujoco><compiler angle="radian"/><worldbody><body><joint name="hinge" axis="0 1 0" '
    'damping="0.1" frictionloss="0.2" armature="0.01" range="-1 1"/><inertial pos="0 0 -0.3" '
    'mass="1" diaginertia="0.1 0.1 0.02"/><geom size="0.1"/></body></worldbody><actuator>'
    '<motor name="drive" joint="hinge" gear="2" ctrlrange="-5 5"/></actuator></mujoco>'
)
SDF = (
    '<sdf version="1.9"><model name="m"><link name="base"/><link name="arm"><pose>0 0 0.1 0 0 0'
    '</pose><inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.02</izz></inertia>'
    '</inertial></link><joint name="hinge" type="revolute"><parent>base</parent><child>arm</child>'
    '<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit><dynamics><damping>0.1'
    '</damping><friction>0.2</friction></dynamics></axis></joint></model></sdf>'
)
TABLES_APART = ('mat', 'h5', 'parquet', 'json')
APART = (*TABLES_APART, 'xml', 'xacro')
WEIGHTS = dict.fromkeys(APART, 0.1)
"""Share of seeds of a format that takes a process of its own."""


def make_samples(folder: Path) -> dict[str, Path]:
    """Write one intact file of each format into a folder; return them by format."""
    t = np.arange(N) * 0.01
    q = np.sin(t)
    (folder / 'x.csv').write_text(
        't,q\n' + '\n'.join(f'{a:.6f},{b:.9g}' for a, b in zip(t, q, strict=True)) + '\n'
    )
    np.savez(folder / 'x.npz', t=t, q=q)
    savemat(folder / 'x.mat', {'t': t, 'q': q, 'log': {'a': q}})
    with h5py.File(folder / 'x.h5', 'w') as file:
        file['log/t'], file['log/q'] = t, q
    pq.write_table(pa.table({'t': t, 'q': q, 'v': [[a, b] for a, b in zip(t, q, strict=True)]}),
                   folder / 'x.parquet')  # fmt: skip
    (folder / 'x.json').write_text(json.dumps({'t': t.tolist(), 'q': q.tolist()}))
    robot = load_robot('toy_pendulum')
    with RecordingWriter(folder / 'x.mcap') as writer:
        for event in states(STATES):
            writer.write_event(event)
    _write_db3(folder / 'x.db3', folder / 'x.mcap')
    _write_ros1(folder / 'x.bag')
    (folder / 'odd.mcap').write_bytes((folder / 'x.mcap').read_bytes())
    (folder / 'x.urdf').write_bytes((ROOT / 'config/robots/panda.urdf').read_bytes())
    (folder / 'x.xml').write_text(MJCF)
    (folder / 'x.sdf').write_text(SDF)
    (folder / 'x.xacro').write_text(
        (ROOT / 'config/robots/panda.urdf')
        .read_text()
        .replace('<robot ', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    )
    (folder / 'x.yaml').write_bytes((ROOT / 'config/robots/linear_axis.yaml').read_bytes())
    (folder / 'params.yaml').write_bytes((ROOT / 'config/reaction_wheel.yaml').read_bytes())
    (folder / 'map.yaml').write_text(json.dumps(MAP))
    engine = Engine(robot, EngineConfig.from_mapping({}, robot))
    save_model(folder / 'model.npz', take_snapshot(engine))
    save_model(folder / 'crafted.npz', taught())
    names = ('x.csv', 'x.npz', 'x.mat', 'x.mcap', 'x.db3', 'x.bag', 'x.urdf', 'x.yaml', 'x.h5',
             'x.parquet', 'x.json', 'x.xml', 'x.sdf', 'x.xacro')  # fmt: skip
    found = {name[2:]: folder / name for name in names}
    found |= {
        'odd': folder / 'odd.mcap',
        'params': folder / 'params.yaml',
        'map': folder / 'map.yaml',
    }
    return found | {'model': folder / 'model.npz', 'crafted': folder / 'crafted.npz'}


def _write_db3(path: Path, mcap: Path) -> None:
    with sqlite3.connect(path) as base:
        base.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
                     'serialization_format TEXT, offered_qos_profiles TEXT)')  # fmt: skip
        base.execute('CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, '
                     'timestamp INTEGER, data BLOB)')  # fmt: skip
        base.execute("INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', "
                     "'cdr', '')")  # fmt: skip
        source = open_recording(mcap)._source  # noqa: SLF001 - the raw messages are wanted
        for number, message in enumerate(source.messages(source.topics)):
            row = (number, 1, message.log_ns, message.data)
            base.execute('INSERT INTO messages VALUES(?, ?, ?, ?)', row)
    base.close()


def _write_ros1(path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    state, header, stamp = (
        store.types[name]
        for name in ('sensor_msgs/msg/JointState', 'std_msgs/msg/Header',
                     'builtin_interfaces/msg/Time')
    )  # fmt: skip
    with Ros1Writer(path) as writer:
        connection = writer.add_connection('/joint_states', state.__msgtype__, typestore=store)
        for i, s in enumerate(states(STATES)):
            head = header(i, stamp(*divmod(s.stamp_ns, 10**9)), '')
            message = state(head, list(s.names), s.position, s.velocity, s.effort)
            data = store.serialize_ros1(message, state.__msgtype__)
            writer.write(connection, s.stamp_ns, data)


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Return a file with some damage; now and then only a little."""
    found = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 2, 5, 30]))):
        at = int(rng.integers(len(found) + 1)) if rng.integers(3) else int(rng.integers(200))
        at, size = min(at, len(found)), int(2 ** rng.uniform(0.0, 9.0))
        kind = int(rng.integers(8))
        if kind == 0:
            found[at : at + 1] = bytes([int(rng.integers(256))])
        elif kind == 1:
            del found[max(at, 1) :]
        elif kind == 2:
            found[at : at + size] = bytes(len(found[at : at + size]))
        elif kind == 3:
            found[at:at] = found[at : at + size] * int(rng.integers(1, 20))
        elif kind == 4:
            found[at:at] = rng.bytes(size)
        elif kind == 5:
            found[at : at + 8] = b'\xff' * len(found[at : at + 8])
        elif kind == 6:
            texts = (
                b'[' * 3000,
                b'1e999999999',
                b'9' * 5000,
                b'&a [*a]',
                b'nan',
                b'-',
                b'<a>' * 200,
            )
            found[at:at] = texts[int(rng.integers(len(texts)))]
        else:
            del found[at : at + size]
    return bytes(found)


def read(kind: str, path: Path) -> None:
    """Read a file as the commands do."""
    if kind in ('csv', 'npz', *TABLES_APART):
        remarks: list[str] = []
        load_columns(path, remarks)
        if kind == 'csv':
            read_table(path, MAP)
    elif kind in BAGS:
        read_bag(path, 0 if kind == 'odd' else STATES)
    elif kind in ('urdf', 'yaml', 'xml', 'sdf', 'xacro'):
        load_robot(str(path))
    elif kind == 'params':
        EngineConfig.from_mapping(load_parameters(path), load_robot('reaction_wheel'))
    elif kind == 'map':
        read_map(path)
    elif kind == 'crafted':
        use_model(path)
    else:
        restored(load_robot('toy_pendulum'), load_model(path))


def run(
    seed: int, samples: dict[str, Path], folder: Path, faults: Faults, *, has_commands: bool = True
) -> tuple[str, str]:
    """Damage and read one file; return its format and what came of it."""
    rng = np.random.default_rng((seed, 4))
    share = np.array([WEIGHTS.get(kind, 1.0) for kind in samples])
    kind = str(rng.choice(list(samples), p=share / share.sum()))
    path = folder / f'damaged{samples[kind].suffix}'
    if kind == 'odd':
        write_odd(path, STATES, rng)
    elif kind == 'crafted':
        path.write_bytes(samples[kind].read_bytes())
        write_crafted(path, rng)
    else:
        path.write_bytes(damaged(samples[kind].read_bytes(), rng))
    began = sum(os.times()[:4])
    try:
        read(kind, path)
    except (SgpError, OSError) as error:
        outcome = 'refused'
        if '\n' in str(error):
            faults.note(f'{kind}: a message of several lines', seed)
    except Exception as error:  # noqa: BLE001 - any escape is what is looked for
        outcome = 'fault'
        faults.note(f'{kind}: {place_of(error)}', seed)
    else:
        outcome = 'read'
    if sum(os.times()[:4]) - began > LONGEST_S:  # of this process and its children
        faults.note(f'{kind}: longer than 10 s', seed)
    if has_commands and outcome == 'read' and kind in BAGS:
        _go_through(kind, path, samples, seed, faults)
    return kind, outcome


def _go_through(
    kind: str, path: Path, samples: dict[str, Path], seed: int, faults: Faults
) -> None:
    """Run the commands on a recording that can be read."""
    remarks = read_bag(path, 0)
    with tempfile.TemporaryDirectory() as out:
        try:
            for fault in faults_of_commands(path, str(samples['sdf']), Path(out), remarks):
                faults.note(f'{kind}: {fault}', seed)
        except Exception as error:  # noqa: BLE001 - as above
            faults.note(f'{kind}: {place_of(error)}', seed)


def main() -> None:
    """Run the seeds and add what came of them to the result."""
    parser = make_parser(__doc__, 'robust_files')
    parser.add_argument('--bags', action='store_true', help='recordings only')
    parser.add_argument('--seeds', type=seed_range, default=range(200), metavar='FIRST:LAST+1')
    arguments = parser.parse_args()
    before = read_result(arguments.out)
    faults, total = Faults(before.get('faults', {})), Counter(before.get('outcomes', {}))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        samples = make_samples(folder)
        if arguments.bags:
            samples = {kind: samples[kind] for kind in (*BAGS, 'sdf')}
        for seed in arguments.seeds:
            total[' '.join(run(seed, samples, folder, faults))] += 1
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if peak > MOST_KILOBYTES:
        faults.note('more than 1 GiB', arguments.seeds.start)
    seeds = [arguments.seeds.start, arguments.seeds.stop]
    write_result(arguments.out, {
        'runs': [*before.get('runs', []), seeds],
        'files': before.get('files', 0) + len(arguments.seeds),
        'peak_megabytes': max(before.get('peak_megabytes', 0), peak // 1024),
        'outcomes': dict(sorted(total.items())), 'faults': dict(faults),
    }, 'mcap', 'rosbags')  # fmt: skip
    print(dict(total), dict(faults))


if __name__ == '__main__':
    main()
