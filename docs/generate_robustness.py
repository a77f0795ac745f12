"""Write docs/robustness.md from the committed results: `python docs/generate_robustness.py`."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np

from sgp_proof.robustness.events import LONGEST_S
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.fitting import ROWS, TOGETHER
from sgp_ros.engine.gate import LARGEST

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'robustness.md'
WITHIN = 1.1
TEMPLATE = Path(__file__).parent / 'templates' / 'robustness.txt'


def _load(name):
    path = ROOT / 'sgp_proof/results' / f'{name}.json'
    return json.loads(path.read_text(encoding='utf-8'))


def _table(title, counts):
    lines = [f'| {title} | number |', '|---|---|']
    return '\n'.join([*lines, *(f'| {name} | {n} |' for name, n in counts.items())])


def _faults(result):
    found = result['faults']
    return 'none' if not found else '; '.join(f'{what}: {n}' for what, n in found.items())


def _garbage(rows):
    """Return the table over all streams but those of a robot that comes to rest."""
    lines = [
        '| garbage | streams | within 10 % | median ratio | worst ratio | lost: within 10 % | lost: worst |',
        '|---|---|---|---|---|---|---|',
    ]
    for kind in dict.fromkeys(row['kind'] for row in rows):
        ratio, lost = (
            np.array([row[name] for row in rows if row['kind'] == kind])
            for name in ('ratio', 'ratio_lost')
        )
        lines.append(
            f'| {kind} | {len(ratio)} | {(ratio <= WITHIN).sum()} | {np.median(ratio):.3g} | '
            f'{ratio.max():.3g} | {(lost <= WITHIN).sum()} | {lost.max():.3g} |'
        )
    return '\n'.join(lines)


def _still(rows):
    """Say which robots the streams beyond the target are of."""
    found = []
    for robot in dict.fromkeys(row['robot'] for row in rows):
        of = [row for row in rows if row['robot'] == robot]
        beyond, lost = (sum(row[name] > WITHIN for row in of) for name in ('ratio', 'ratio_lost'))
        median = np.median([row['nmse'] for row in of])
        found.append(
            f'`{robot}`: {beyond} of {len(of)} with garbage, {lost} with losses (median nMSE '
            f'of the clean streams {median:.2g})'
        )
    kept = sum(min(row['ratio'], row['ratio'] / row['ratio_lost']) <= WITHIN for row in rows)
    return (
        f'Beyond 10 %: {"; ".join(found)}. Within 10 % of the clean stream, or of the one that lost '
        f'the same messages: {kept} of {len(rows)}.'
    )


def _many(result):
    lines = [
        '| rate [Hz] | processor time per second of data [s] | of it for fits [s] | in the second half [s] | longest step, fit [s] | median nMSE |',
        '|---|---|---|---|---|---|',
    ]
    for name, x in result['runs'].items():
        lines.append(
            f'| {name.removesuffix("Hz")} | {x["load"]:.2f} | {x["load_of_fits"]:.2f} | '
            f'{x["load_later"]:.2f} | {x["longest_step_s"]:.2f}, {x["longest_fit_s"]:.1f} | {x["nmse_median"]:.1e} |'
        )
    return '\n'.join(lines)


def _kills(result):
    kinds = dict.fromkeys(name.split()[0] for name in result['by_signal'])
    signals = ('SIGKILL', 'SIGTERM', 'SIGINT')
    lines = ['| what | ' + ' | '.join(signals) + ' |', '|---|---|---|---|']
    for kind in kinds:
        numbers = [str(result['by_signal'].get(f'{kind} {name}', 0)) for name in signals]
        lines.append(f'| {kind} | {" | ".join(numbers)} |')
    return '\n'.join(lines)


def _disk(result):
    names = ', '.join(f'`{name}`' for name in result['commands'])
    return f'{names}: faults: {"; ".join(result["faults"]) or "none"}.'


def _harm(faults):
    """Return what went wrong with which file, and with how many of its commands."""
    found = {}
    for title, texts in faults.items():
        for text in texts:
            found.setdefault((title.partition(': ')[0], text), []).append(title)
    said = (f'{name}: {text} (commands: {len(titles)})' for (name, text), titles in found.items())
    return '; '.join(said) or 'none'


def _readers(cases):
    """Return the commands, with the option by which they were given a file."""
    found = set()
    for title in cases:
        words = title.partition(': ')[2].split()
        before = words[words.index('{}') - 1]
        found.add(f'`{words[0]} {before}`' if before.startswith('--') else f'`{words[0]}`')
    return ', '.join(sorted(found))


def _gate_time(result):
    lines = [
        '| stream | what | equation, with and without [µs] | grows by | other steps [µs] | stream grows by |',
        '|---|---|---|---|---|---|',
    ]
    for name, parts in result['streams'].items():
        for part, x in parts.items():
            both = (x['us_equation'], x['us_message'])
            equation, message = (f'{y["with"]:.1f}, {y["without"]:.1f}' for y in both)
            lines.append(
                f'| {name}, {result["rates_hz"][name]:g} Hz | {part} | {equation} | '
                f'{100 * x["growth_equation"]:.1f} % | {message} | {100 * x["growth"]:.1f} % |'
            )
    return '\n'.join(lines)


def _machines(results):
    """Return what was measured on which machine, with its versions."""
    found = {}
    for name, result in results.items():
        x = result['environment']
        machine = f'{x["processor"]}, Python {x["python"]}, NumPy {x["numpy"]}'
        found.setdefault(machine, []).append(name)
    return '; '.join(f'{machine} ({", ".join(names)})' for machine, names in found.items())


def text() -> str:
    """Return the page."""
    events, files, gates = (_load(f'robust_{n}') for n in ('events', 'files', 'gates'))
    messages, kills, disk = (_load(f'robust_{n}') for n in ('messages', 'kills', 'disk'))
    gate_time, summary = _load('robust_gate_time'), gates['summary']
    harm = _load('robust_harmful')
    rate = summary['falsely_refused'] / summary['equations']
    many = _load('many_joints')
    known = {x.name: x.default for x in fields(EngineConfig)}
    period, budget = known['refit_period'], known['buffer_budget']
    return TEMPLATE.read_text(encoding='utf-8').format(
        EVENTS=events['events'], EVENT_RUNS=len(events['runs']), EVENT_FAULTS=_faults(events),
        EVENT_MB=events['peak_megabytes'], EVENT_COUNTS=_table('event', events['counts']),
        FILES=files['files'], FILE_FAULTS=_faults(files), FILE_MB=files['peak_megabytes'],
        FILE_COUNTS=_table('format and outcome', files['outcomes']),
        EQUATIONS=summary['equations'], REFUSED=summary['falsely_refused'], RATE=f'{1e2 * rate:.2g}',
        LARGEST=f'{LARGEST:g}', BOUND=f'{1e2 / LARGEST**2:.2g}', STREAMS=len(gates['clean']),
        GARBAGE=_garbage(gates['garbage']), STILL=_still(gates['garbage']),
        MANY=_many(many), MANY_JOINTS=many['joints'], MANY_COEFFICIENTS=many['coefficients'],
        MANY_S=many['data_s'], PERIOD=period, FITTED=ROWS // budget, TOGETHER=TOGETHER,
        ELAPSED=f'{max(x["elapsed_per_s"] for x in many["runs"].values()):.1f}',
        MESSAGES=messages['messages'],
        MESSAGE_FAULTS=_faults(messages), MESSAGE_MB=messages['peak_megabytes'],
        HARM=harm['number'], HARM_S=harm['most_seconds'], HARM_MB=harm['most_megabytes'],
        HARM_FILES=len({name.partition(':')[0] for name in harm['cases']}),
        HARM_FAULTS=_harm(harm['faults']),
        HARM_LIMIT=LONGEST_S, HARM_COMMANDS=_readers(harm['cases']), GATE_TIME=_gate_time(gate_time), KILLS=kills['number'], KILL_FAULTS=_faults(kills), KILL_COUNTS=_kills(kills),
        KEPT='; '.join(f'{n} {kept}' for kept, n in kills['kept'].items()),
        LOST=f'{kills["most_lost_s"]:.2f}', DISK=_disk(disk),
        MACHINE=_machines({
            'events': events, 'messages': messages, 'files': files, 'malicious files': harm,
            'kills': kills, 'disks': disk, 'gates': gates, 'their cost': gate_time,
            'thirty joints': many,
        }),
    )  # fmt: skip


def main() -> None:
    """Write it."""
    TARGET.write_text(text(), encoding='utf-8')


if __name__ == '__main__':
    main()
