"""Write docs/recordings.md from committed results: `python docs/generate_recordings.py`."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'recordings.md'
RESULTS = ROOT / 'benchmarks' / 'results'
PUBLISHED = {'M': 95.1089, 'Fv': 203.5034, 'Fc': 20.3935, 'offset': -3.1648}
"""Janot, Gautier, Brunot 2019."""

PAGE = """# Real recordings

Written by `python docs/generate_recordings.py` from what `python -m benchmarks.recordings` measured,
{environment}. The recordings are those of their authors (sources in each section); `sgp import` with
the maps in `config/import/` turns them into MCAP, where they are not already. Every method learns from
the same rows and is scored on rows that none has seen: nMSE is the mean squared error over the variance
of the target, both behind the low-pass that the recording itself chose; coverage is the share inside
the 95 % interval. Near and far are the halves of the held-out rows that lie closer to and further from
the states learned from.

## EMPS: a linear axis

A ball-screw axis with a DC motor at 1 kHz (Janot, Gautier, Brunot 2019). Learned from the identification
record, scored on the one with disturbance pulses.

```bash
{emps_command}
```

| parameter | found | 95 % interval | published |
|---|---|---|---|
{emps_parameters}

Relative error of the force, root of the summed squares: identification record {emps_train_pr} physics alone,
{emps_train_sgp} with Z (published: 4.08 %); validation record {emps_val_pr} and {emps_val_sgp} (published:
5.98 %). The published errors are of unfiltered data, ours behind a low-pass of {emps_cutoff} Hz.

{emps_table}

What SGP buys: the friction of this axis is asymmetric and not quite linear, which the four columns cannot
say; Z takes up half of what they leave, near and far alike. What it does not: intervals of a model frozen and
taken to the other record cover {emps_cover}, those of the physics alone {emps_cover_pr}: Z takes what it learned for
what is true of the other record too.

## Panda: seven joints with torque sensors

Exciting trajectory of Gaz, Cognetti, Oliva, Robuffo Giordano and De Luca (RA-L 2019), 21 s at 1 kHz; the first 60 %
learned from, the last 40 % held out.

```bash
{panda_command}
```

{panda_table}

Mean nMSE {panda_pr} parametric, {panda_sgp} with Z behind {panda_cutoff} Hz; behind 5 Hz {panda5_pr} and {panda5_sgp}. Those who
collected the recordings found 0.0049 with the same structure, behind a low-pass they do not state. The published sigmoid friction with refitted rigid part
reaches 0.0076 (low-passed likewise; computed by those who collected the recordings). Joint 7 decides the
mean: its torque is hardly more than friction. A trap of this recording: the path repeats after 13.35 s, so
most of what is held out is a second pass over what was learned. The score tells of repeatability and
noise; of motions of another kind the far half tells a little more. GP alone fails even so where the second pass
differs.

## TIAGo: four joints of an arm, from motor currents

A run of PAL's TIAGo from the figaroh examples, 80 s at 100 Hz with stamps that jitter; efforts are motor
currents. Alternate stretches of 6 s held out.

```bash
{tiago_command}
```

{tiago_table}

All joints stacked: {tiago_pr} parametric, {tiago_sgp} with Z, behind the {tiago_cutoff} Hz that the recording chose; the
currents carry noise and steps above a few hertz that no model can know, so the number depends on the
cut-off: behind 5 Hz (`--cutoff 5`) it is {tiago5_pr} and {tiago5_sgp}. The 0.058 of those who collected the
recordings was found with alternate stretches too, behind a low-pass that they do not state. What the
physics leaves is not white (correlation {tiago_white} from row to row): gears, cables and a current that
is no torque.

## Double pendulum through inverse regression

DFKI's double pendulum, designs A.0 and C.0: one run learned from and one held out. It is the wrong tool for this
machine, whose torques are small differences of large terms, and coverage says so; fitted by roll-outs
instead it does well: [pendulums.md](pendulums.md).

{double_tables}

## What the choice of the filter looked like

{filters}
"""


def _load(name):
    return json.loads((RESULTS / f'{name}_identified.json').read_text(encoding='utf-8'))


def _percent(x, digits=0):
    return f'{100 * x:.{digits}f} %'


def _table(findings):
    """Return nMSE and coverage per joint and method on what was held out, near and far."""
    scores = findings['scores']
    lines = ['| held out | joint | ' + ' | '.join(scores) + ' |', '|---' * (len(scores) + 2) + '|']
    for region in (name for name in findings['rows'] if name != 'train'):
        place = region.rpartition(', ')[2] if region.endswith((', near', ', far')) else 'all'
        for joint in findings['joints']:
            cells = []
            for method in scores.values():
                cell = method[region]['joints'][joint]
                cells.append(f'{cell["nmse"]:.2g}, {_percent(cell["coverage95"])}')
            lines.append(f'| {place} | {joint} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def _held(findings):
    return next(name for name in findings['rows'] if name != 'train')


def _score(findings, method, key, region=None):
    return findings['scores'][method][region or _held(findings)][key]


def _filters(results):
    lines = [
        '| recording | cut-off | rows/s | velocity | correlation of the residual |',
        '|---' * 5 + '|',
    ]
    for name, result in results.items():
        plan = result['findings']['filter']
        lines.append(
            f'| {name} | {plan["cutoff_hz"]:g} Hz | {plan["rate_hz"]:.3g} | '
            f'{plan["velocity_source"]} | {plan["residual_autocorrelation"]:.2f} |'
        )
    return '\n'.join(lines)


def text():
    """Return the page."""
    results = {name: _load(name) for name in ('emps', 'panda', 'tiago')}
    emps, panda, tiago = (results[n]['findings'] for n in ('emps', 'panda', 'tiago'))
    panda5, tiago5 = (_load(f'{n}_5hz')['findings'] for n in ('panda', 'tiago'))
    doubles = {f'{d}.0': _load(f'double_pendulum_{d.lower()}0') for d in 'AC'}
    machine = results['emps']['environment']
    parameters = [
        f'| {p["name"]} [{p["unit"]}] | {p["value"]:.5g} | ± {1.96 * p["std"]:.2g} | '
        f'{PUBLISHED[p["name"]]:.5g} |'
        for p in emps['parameters']
    ]
    return PAGE.format(
        environment=f'{machine["cores"]} cores of {machine["processor"]}, Python {machine["python"]}',
        emps_command=results['emps']['command'],
        panda_command=results['panda']['command'],
        tiago_command=results['tiago']['command'],
        emps_parameters='\n'.join(parameters),
        emps_train_pr=_percent(_score(emps, 'PR', 'relative_error', 'train'), 2),
        emps_train_sgp=_percent(_score(emps, 'SGP', 'relative_error', 'train'), 2),
        emps_val_pr=_percent(_score(emps, 'PR', 'relative_error'), 2),
        emps_val_sgp=_percent(_score(emps, 'SGP', 'relative_error'), 2),
        emps_cutoff=f'{emps["filter"]["cutoff_hz"]:g}',
        emps_cover=_percent(_score(emps, 'SGP', 'joints')['axis']['coverage95']),
        emps_cover_pr=_percent(_score(emps, 'PR', 'joints')['axis']['coverage95']),
        emps_table=_table(emps),
        panda_cutoff=f'{panda["filter"]["cutoff_hz"]:g}',
        panda5_pr=f'{_score(panda5, "PR", "mean_nmse"):.4f}',
        panda5_sgp=f'{_score(panda5, "SGP", "mean_nmse"):.4f}',
        tiago5_pr=f'{_score(tiago5, "PR", "stacked_nmse"):.3f}',
        tiago5_sgp=f'{_score(tiago5, "SGP", "stacked_nmse"):.3f}',
        panda_table=_table(panda),
        panda_pr=f'{_score(panda, "PR", "mean_nmse"):.4f}',
        panda_sgp=f'{_score(panda, "SGP", "mean_nmse"):.4f}',
        tiago_table=_table(tiago),
        tiago_pr=f'{_score(tiago, "PR", "stacked_nmse"):.3f}',
        tiago_sgp=f'{_score(tiago, "SGP", "stacked_nmse"):.3f}',
        tiago_cutoff=f'{tiago["filter"]["cutoff_hz"]:g}',
        tiago_white=f'{tiago["filter"]["residual_autocorrelation"]:.2f}',
        double_tables='\n\n'.join(
            f'Design {name}, `{found["command"]}`:\n\n' + _table(found['findings'])
            for name, found in doubles.items()
        ),
        filters=_filters(results),
    )


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
