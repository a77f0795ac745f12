"""Kills by seed: the old result or the new one, nothing left behind, nothing lost of a record.

    python -m sgp_proof.robustness.kills --seeds 0:100

Each seed starts the node or one of three commands and ends it, a command with all processes of its
group, with SIGKILL, SIGTERM or SIGINT at a random moment: anywhere in its run, while it writes, or
while its results take their names. A command writes into a folder that holds the results of a run
before; these must be untouched, or all replaced, and after the next run no other file may be
there. What a node had published before must be in its record, but for what was made in the last
second before a SIGKILL.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgp_proof.result_files import ROOT, make_parser, read_result, seed_range, write_result
from sgp_proof.robustness.events import Faults
from sgp_proof.robustness.result_folders import (
    TURN_S,
    broken_in,
    litter_in,
    results_in,
    wait_until_settled,
)

COMMANDS = ('replay', 'identify', 'diagnose')
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ENDED = {signal.SIGKILL: (-9,), signal.SIGTERM: (-15, 130), signal.SIGINT: (-2, 130)}
"""Exit statuses: of the signal itself, or that of an interrupted command."""
ROBOT = ROOT / 'config/robots/revolute_axis.urdf'
RECORDED_S = 6.0
DEADLINE_S = 300.0
NEXT_RUN = 3
"""Kills of a command after which it runs undisturbed."""


def run_command(name: str, bag: Path, out: Path) -> subprocess.Popen[bytes]:
    """Start a command of ours."""
    return subprocess.Popen(
        [sys.executable, '-m', 'sgp_ros.cli', name, str(bag), '--robot', str(ROBOT), '--out',
         str(out), '--quiet'],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip


def make_recordings(folder: Path) -> list[Path]:
    """Return two short recordings of one robot."""
    found = []
    for seed in (0, 1):
        place = folder / f'sim{seed}'
        subprocess.run(
            [sys.executable, '-m', 'sgp_ros.cli', 'simulate', str(ROBOT), '--seed', str(seed),
             '--duration', str(RECORDED_S), '--out', str(place), '--quiet'], check=True,
        )  # fmt: skip
        found.append(next(place.glob('*.mcap')))
    return found


@dataclass
class Timed:
    """How long an undisturbed run takes, and its writing at the end [s]."""

    whole_s: float
    writing_s: float


class CommandKills:
    """Kills of one command, which writes into one folder again and again.

    Args:
        name: of the command.
        bags: two recordings, taken in turn.
        folder: where the results are.
    """

    def __init__(self, name: str, bags: list[Path], folder: Path) -> None:
        self.name, self._bags, self._out = name, bags, folder / name
        self._turn = 0
        self._undisturbed()
        self._timed = self._undisturbed()

    def kill(self, rng: np.random.Generator, number: signal.Signals) -> dict[str, object]:
        """Kill a run; return what came of it, with `faults`."""
        before, litter, faults = results_in(self._out), set(litter_in(self._out)), []
        moment = str(rng.choice(['anywhere', 'writing', 'renaming'], p=[0.4, 0.4, 0.2]))
        process = self._start()
        try:
            self._wait(process, moment, rng)
            if process.poll() is None:
                os.killpg(process.pid, number)
            _, said = process.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            faults.append('lives 10 s after the signal')
            said = b''
        finally:
            process.kill()
            process.wait()
        status, text = process.returncode, said.decode(errors='replace')
        if status not in (0, *ENDED[number]):
            faults.append(f'status {status}')
        if status == 130 and text.count('\n') != 1:
            faults.append('not one line')
        faults += wait_until_settled(self._out)
        after = results_in(self._out)
        is_cut = any(name.endswith('.moves') for name in litter_in(self._out))
        kept = 'old' if after == before else 'new'
        listing = json.loads((self._out / f'.sgp_{self.name}.json').read_text(encoding='utf-8'))
        if is_cut:
            kept = 'old, and new once the next run begins'
            if after != before:
                faults.append('old results beside new ones, until the next run')
        elif kept == 'new' and (set(listing) != set(after) or self._is_mixed(before, after)):
            faults.append('old results beside new ones')
        faults += [f'half a file: {name}' for name in broken_in(self._out)]
        if number != signal.SIGKILL and status == 130 and set(litter_in(self._out)) - litter:
            faults.append('an interrupted run leaves files behind')
        if is_cut or self._turn % NEXT_RUN == 0:
            self._undisturbed()
            faults += [f'left behind: {name}' for name in litter_in(self._out)]
            faults += [f'after the next run, half a file: {x}' for x in broken_in(self._out)]
        return {'what': self.name, 'moment': moment, 'status': status, 'kept': kept,
                'faults': faults}  # fmt: skip

    @staticmethod
    def _is_mixed(before: dict[str, str], after: dict[str, str]) -> bool:
        """Whether main results, which differ from run to run, are partly the old ones."""
        main = [n for n in after if n.endswith(('.json', '.html')) and n in before
                and 'foxglove' not in n]  # fmt: skip
        return len({after[name] == before[name] for name in main}) > 1

    def _start(self) -> subprocess.Popen[bytes]:
        self._turn += 1
        return run_command(self.name, self._bags[self._turn % 2], self._out)

    def _wait(
        self, process: subprocess.Popen[bytes], moment: str, rng: np.random.Generator
    ) -> None:
        """Wait for a random moment of a run, at most until it ends."""
        end = time.monotonic() + DEADLINE_S
        if moment == 'anywhere':
            end = time.monotonic() + rng.uniform(0.0, 1.1 * self._timed.whole_s)
        elif moment == 'writing':
            self._until(process, '.sgp_growing_', end)
            end = time.monotonic() + rng.uniform(0.0, 1.1 * self._timed.writing_s)
        else:
            self._until(process, f'.sgp_{self.name}.moves', end)
            return
        while time.monotonic() < end and process.poll() is None:
            time.sleep(TURN_S)

    def _until(self, process: subprocess.Popen[bytes], beginning: str, end: float) -> None:
        while time.monotonic() < end and process.poll() is None:
            if next(self._out.glob(f'{beginning}*'), None) is not None:
                return
            time.sleep(TURN_S)

    def _undisturbed(self) -> Timed:
        """Run once to the end."""
        began, process = time.monotonic(), self._start()
        try:
            self._until(process, '.sgp_growing_', began + DEADLINE_S)
            writing = time.monotonic()
            _, said = process.communicate(timeout=DEADLINE_S)
        finally:
            process.kill()
            process.wait()
        if process.returncode:
            raise SystemExit(f'{self.name} ends with {process.returncode}: {said.decode()}')
        return Timed(time.monotonic() - began, time.monotonic() - writing)


def run(
    seeds: Iterable[int], faults: Faults, what: tuple[str, ...], minutes: float
) -> Iterator[dict[str, Any]]:
    """Kill once a seed, as long as there is time; yield what came of each."""
    end = time.monotonic() + 60.0 * minutes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bags = make_recordings(folder) if set(what) & set(COMMANDS) else []
        kinds: dict[str, Any] = {}
        try:
            for seed in seeds:
                if time.monotonic() > end:
                    break
                rng = np.random.default_rng((seed, 5))
                kind = what[seed % len(what)]
                if kind not in kinds and kind == 'node':
                    from sgp_proof.robustness.node_kills import (  # noqa: PLC0415 - needs rclpy
                        NodeKills,
                    )

                    kinds[kind] = NodeKills(folder)
                elif kind not in kinds:
                    kinds[kind] = CommandKills(kind, bags, folder)
                number = SIGNALS[int(rng.choice(3, p=[0.6, 0.2, 0.2]))]
                row = {'seed': seed, 'signal': number.name, **kinds[kind].kill(rng, number)}
                print(row, flush=True)
                for fault in row['faults']:
                    faults.note(f'{kind}: {fault}', seed)
                yield row
        finally:
            if 'node' in kinds:
                kinds['node'].close()


def main() -> None:
    """Run the seeds that are not in the result yet, or had faults, and add what came of them."""
    parser = make_parser(__doc__, 'robust_kills', ('node', *COMMANDS))
    parser.add_argument('--seeds', type=seed_range, default=range(20), metavar='FIRST:LAST+1')
    parser.add_argument('--minutes', type=float, default=1e9, help='after which no seed begins')
    arguments = parser.parse_args()
    rows = {row['seed']: row for row in read_result(arguments.out).get('kills', [])}
    seeds = [seed for seed in arguments.seeds if seed not in rows or rows[seed]['faults']]
    for row in run(seeds, Faults(), tuple(arguments.names), arguments.minutes):
        rows[row['seed']] = row
        _write(arguments.out, [rows[seed] for seed in sorted(rows)])


def _write(path: Path, kills: list[dict[str, Any]]) -> None:
    table = Counter(f'{row["what"]} {row["signal"]}' for row in kills)
    lost = [row['lost_s'] for row in kills if row.get('lost_s') is not None]
    found = Counter(f'{row["what"]}: {fault}' for row in kills for fault in row['faults'])
    write_result(path, {
        'number': len(kills), 'by_signal': dict(sorted(table.items())),
        'kept': dict(Counter(row['kept'] for row in kills if 'kept' in row)),
        'most_lost_s': max(lost, default=None), 'faults': dict(found), 'kills': kills,
    }, 'mcap')  # fmt: skip


if __name__ == '__main__':
    main()
