"""Write docs/recordings.md from committed results: `python docs/generate_recordings.py`."""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'recordings.md'
RESULTS = ROOT / 'sgp_proof' / 'results'
PUBLISHED = {'M': 95.1089, 'Fv': 203.5034, 'Fc': 20.3935, 'offset': -3.1648}
"""Janot, Gautier, Brunot 2019."""

PAGE = (Path(__file__).parent / 'templates' / 'recordings.txt').read_text(encoding='utf-8')


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


def _cutoffs(rows, key):
    lines = ['| cut-off [Hz] | ' + ' | '.join(f'{r["cutoff_hz"]:g}' for r in rows[::2]) + ' |']
    lines.append('|---' * (len(rows) // 2 + 1) + '|')
    for name in ('white', 'dense'):
        cells = [f'{r[key]:.2g}' for r in rows if r['rows'] == name]
        lines.append(f'| {name} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines)


def _inputs(inputs, key):
    lines = ['| Z sees | new motion | held out | of each joint, held out |', '|---|---|---|---|']
    for name, found in inputs.items():
        each = ' '.join(f'{x:.2g}' for x in found['held_out']['joints'])
        cells = (f'{found[region][key]:.3g}' for region in ('new_motion', 'held_out'))
        lines.append(f'| {name} | {" | ".join(cells)} | {each} |')
    return '\n'.join(lines)


def _passes(arm):
    passes = arm['passes']
    lines = ['| nMSE, second pass | ' + ' | '.join(str(i + 1) for i in range(len(arm['joints'])))]
    lines[0] += ' |'
    lines.append('|---' * (len(arm['joints']) + 1) + '|')
    for title, key in (('physics alone', 'physics'), ('not repeatable', 'not_repeatable')):
        lines.append(
            f'| {title} | ' + ' | '.join(f'{x:.2g}' for x in passes[key]['joints']) + ' |'
        )
    return '\n'.join(lines)


def _coefficients(fits):
    names = list(next(iter(fits.values())))
    lines = ['| fitted to | ' + ' | '.join(names) + ' |', '|---' * (len(names) + 1) + '|']
    for name, fit in fits.items():
        cells = (f'{c["value"]:.4g} ({c["std"]:.2g})' for c in fit.values())
        lines.append(f'| {name} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _calibration(sets):
    lines = ['| Z sees | own record | other record | coverage there | widened |', '|---' * 5 + '|']
    for name, found in sets.items():
        shares = (_percent(found[key]) for key in ('coverage95', 'widened'))
        cells = (f'{found["inside"]:.2f}', f'{found["outside"]:.2f}', *shares)
        lines.append(f'| {name} | {" | ".join(cells)} |')
    return '\n'.join(lines)


def _shares(values):
    return ', '.join(f'{x:.2g}' for x in values)


def _live(recordings):
    titles = ('recording', 'states live, refused', 'numbers that differ', 'joint')
    titles += ('acceleration, replay', 'live', 'effort, replay', 'live')
    lines = [f'| {" | ".join(titles)} |', '|---' * len(titles) + '|']
    for name, found in recordings.items():
        samples, same = found['live']['samples'], found['live_equals_replay']
        taken = f'{samples["read"]} of {found["live"]["published"]}, '
        taken += str(sum(samples['refused'].values()))
        different = f'{same["numbers_different"]} of {same["numbers_compared"]}'
        for i, joint in enumerate(found['replay']['joints']):
            first = (name, taken, different) if i == 0 else ('', '', '')
            cells = [
                f'{score["nmse"]:.2g}, {_percent(score["coverage95"])}'
                for channel in ('acceleration', 'effort')
                for side in ('replay', 'live')
                for score in [found[side]['joints'][joint][channel]]
            ]
            lines.append(f'| {" | ".join((*first, joint, *cells))} |')
    return '\n'.join(lines)


def _coverage(recordings):
    """Return scores of every joint, live and frozen."""
    titles = ('recording', 'joint', 'effort', 'physics alone', 'weight of Z', 'coverage', 'width')
    titles += ('acceleration', 'coverage', 'width')
    lines = [f'| {" | ".join(titles)} |', '|---' * len(titles) + '|']
    for name, found in recordings.items():
        for mode in ('live', 'frozen'):
            for joint, scores in found[mode].items():
                effort, acceleration = (
                    (
                        f'{s["nmse"]:.2g}',
                        f'{_percent(s["coverage95"])} ({_percent(s["raw_coverage95"])})',
                        f'{s["width_ratio"]:.2f}',
                    )
                    for s in (scores['effort'], scores['acceleration'])
                )
                beside = f'{scores["physics_alone"]:.2g}', f'{scores["process_weight"]:.2f}'
                cells = (f'{name}, {mode}', joint, effort[0], *beside, *effort[1:], *acceleration)
                lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines)


def _coverage_counts(recordings):
    """Return in how many of all cells, joints live and frozen, each aim is met."""
    joints = [s for r in recordings.values() for m in ('live', 'frozen') for s in r[m].values()]
    found = {'cells': str(len(joints))}
    for channel in ('effort', 'acceleration'):
        scores = [joint[channel] for joint in joints]
        found[f'{channel}_covered'] = str(sum(0.93 <= s['coverage95'] <= 0.97 for s in scores))
        found[f'{channel}_narrow'] = str(sum(s['width_ratio'] <= 1.3 for s in scores))
    found['effort_no_worse'] = str(sum(s['effort']['nmse'] <= s['physics_alone'] for s in joints))
    found['acceleration_worst'] = f'{max(s["acceleration"]["nmse"] for s in joints):.2g}'
    found['acceleration_below'] = str(sum(s['acceleration']['nmse'] < 0.3 for s in joints))
    return found


def _evidence():
    """Return what the page says of residuals and of the live runs."""
    residuals, live, coverage = (
        json.loads((RESULTS / f'{name}.json').read_text(encoding='utf-8'))
        for name in ('residuals', 'live_recordings', 'coverage')
    )
    panda, tiago = residuals['arms']['panda'], residuals['arms']['tiago']
    sessions = residuals['emps_sessions']
    one, other = (sessions['coefficients'][name]['M'] for name in ('emps_id', 'emps_val_pulses'))
    apart = abs(one['value'] - other['value']) / (one['std'] ** 2 + other['std'] ** 2) ** 0.5
    near = {name: arm['noise_share']['median_distance'] for name, arm in residuals['arms'].items()}
    every = _load('panda_every_velocity')['findings']
    return {
        'mass_apart': f'{apart:.1f}',
        'emps_coefficients': _coefficients(sessions['coefficients']),
        'emps_calibration': _calibration(sessions['calibration']),
        'pass_distance': f'{panda["passes"]["largest_distance_rad"]:.2g}',
        'panda_far': f'{max(near["panda"]["all"]):.2g}',
        'tiago_near': f'{max(near["tiago"]["own"]):.2g}',
        'tiago_far': f'{max(near["tiago"]["all"]):.2g}',
        'panda_cutoffs': _cutoffs(panda['cutoffs'], 'mean'),
        'tiago_cutoffs': _cutoffs(tiago['cutoffs'], 'stacked'),
        'period': f'{panda["passes"]["period_s"]:.2f}',
        'pass_pr': f'{panda["passes"]["physics"]["mean"]:.4f}',
        'pass_floor': f'{panda["passes"]["not_repeatable"]["mean"]:.4f}',
        'panda_passes': _passes(panda),
        'panda_inputs': _inputs(panda['inputs'], 'mean'),
        'tiago_inputs': _inputs(tiago['inputs'], 'stacked'),
        'every_pr': f'{_score(every, "PR", "mean_nmse"):.4f}',
        'every_sgp': f'{_score(every, "SGP", "mean_nmse"):.4f}',
        'panda_own': _shares(panda['noise_share']['share']['own']),
        'panda_all': _shares(panda['noise_share']['share']['all']),
        'tiago_own': _shares(tiago['noise_share']['share']['own']),
        'tiago_all': _shares(tiago['noise_share']['share']['all']),
        'tiago_best': f'{tiago["inputs"]["own position, direction"]["held_out"]["stacked"]:.3f}',
        'wall': f'{live["wall_s"]:g}',
        'live': _live(live['recordings']),
        'coverage': _coverage(coverage['recordings']),
        **_coverage_counts(coverage['recordings']),
    }  # fmt: skip


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
        **_evidence(),
    )


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
