"""Write docs/unlisted.md from the committed results: `python docs/generate_unlisted.py`."""

from __future__ import annotations

import json
import statistics
from pathlib import Path

from sgp_proof.concealed.baselines import library
from sgp_proof.concealed.sizes import LEAST_BEYOND
from sgp_proof.concealed.unlisted import SAME

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'unlisted.md'
RESULTS = ROOT / 'sgp_proof/results/unlisted_ninth.json'
NINTH_AGAIN = ROOT / 'sgp_proof/results/unlisted_ninth_again.json'
EIGHTH = ROOT / 'sgp_proof/results/unlisted_eighth.json'
EIGHTH_AGAIN = ROOT / 'sgp_proof/results/unlisted_eighth_again.json'
SEVENTH = ROOT / 'sgp_proof/results/unlisted_seventh.json'
SIXTH = ROOT / 'sgp_proof/results/unlisted_sixth.json'
SIXTH_AGAIN = ROOT / 'sgp_proof/results/unlisted_sixth_again.json'
FIFTH = ROOT / 'sgp_proof/results/unlisted_fifth.json'
FOURTH = ROOT / 'sgp_proof/results/unlisted_fourth.json'
THIRD = ROOT / 'sgp_proof/results/unlisted_third.json'
AGAIN = ROOT / 'sgp_proof/results/unlisted_third_again.json'
FOURTH_AGAIN = ROOT / 'sgp_proof/results/unlisted_fourth_again.json'
FIFTH_AGAIN = ROOT / 'sgp_proof/results/unlisted_fifth_again.json'
FIRST = ROOT / 'sgp_proof/results/unlisted.json'
BASELINES = ROOT / 'sgp_proof/results/unlisted_baselines.json'
WITHHELD = ROOT / 'sgp_proof/results/withheld.json'
NO_LAW = ROOT / 'sgp_proof/results/no_law.json'
ELASTIC = ROOT / 'sgp_proof/results/elastic.json'
MOUNT = ROOT / 'sgp_proof/results/mount.json'
TOOL = ROOT / 'sgp_proof/results/tool_forces.json'
_HEAD = (Path(__file__).parent / 'templates/unlisted.txt').read_text(encoding='utf-8')


def text():
    """Return the page."""
    from sgp_ros.diagnosis.criteria import LEAST_LAW  # noqa: PLC0415 - beside its use

    result = json.loads(RESULTS.read_text(encoding='utf-8'))
    rows, summary = result['cases'], result['summary']
    earlier = {'first': FIRST, 'third': THIRD, 'again': AGAIN, 'fourth': FOURTH,
               'fourth_again': FOURTH_AGAIN, 'fifth': FIFTH, 'fifth_again': FIFTH_AGAIN,
               'sixth': SIXTH, 'sixth_again': SIXTH_AGAIN, 'seventh': SEVENTH, 'eighth': EIGHTH,
               'eighth_again': EIGHTH_AGAIN, 'ninth_again': NINTH_AGAIN}  # fmt: skip
    known = {f'{name}_{key}': value for name, path in earlier.items()
             for key, value in _rates(path).items()}  # fmt: skip
    numbers = sorted(int(r['case'].rpartition('_')[2]) for r in rows)
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers))), 'scored in order'
    return _HEAD.format(
        **_no_law(), **_tool_forces(), **_resonance('elastic', ELASTIC), **_resonance('mount', MOUNT),
        **known,
        terms=len(library(['a'])), baselines=_baselines(_cases(FOURTH)), **_sizes(result),
        failures=_failures(rows), wrong_error=_share(max(_errors(rows), default=0.0)), worlds=summary['worlds'],
        families=len({r['kind'] for r in rows}), found=_share(summary['found']),
        right=_share(summary['right_joint']), wrong=_share(summary['wrong_names']),
        unexplained=sum(r['verdict'] == 'unexplained' for r in rows if not r['found']),
        sealed=result['sealed'], table=_table(rows), machines=_machines(), upper=100.0 * (1.0 - 0.05 ** (1.0 / summary['worlds'])),
        seeds=f'{numbers[0]}:{numbers[0] + result["sealed"]}', least=100.0 * LEAST_LAW,
    )  # fmt: skip


def _errors(rows):
    """Return the errors of laws that are not the true ones, relative."""
    return [e for r in rows if r['wrong'] for e in r['law_error'] if e is not None]


def _cases(path):
    return json.loads(path.read_text(encoding='utf-8'))['cases']


def _sizes(result):
    """Return the shares of the laws in the effort of their joints, and how many mislead."""
    rows = result['cases']
    found = [r['share'] for r in rows]
    return {'smallest': _share(min(found)), 'largest': _share(max(found)),
            'median': _share(statistics.median(found)), 'beyond': _share(LEAST_BEYOND),
            'far_worse': _far_worse(rows)}  # fmt: skip


def _far_worse(rows):
    """Return the share of worlds whose wider motion is predicted worse than by the nominal."""
    known = [r['far'] for r in rows if r['far'].get('after') is not None]
    return _share(sum(far['after'] > far['before'] for far in known) / len(rows))


def _rates(path):
    """Return how many worlds of a set there are, and what was found and named wrongly."""
    result = json.loads(path.read_text(encoding='utf-8'))
    summary = result['summary']
    return {'worlds': summary['worlds'], 'found': _share(summary['found']),
            'wrong': _share(summary['wrong_names']),
            'far_worse': _far_worse(result['cases'])}  # fmt: skip


def _baselines(rows):
    """Return the rows of the table of other ways, this one first, on the same worlds."""
    cases = [r['case'] for r in rows]
    result = json.loads(BASELINES.read_text(encoding='utf-8'))
    others = [r for r in result['cases'] if r['case'] in cases]
    assert len(others) == len(cases), 'the same worlds'
    far = [r['far']['after'] / r['far']['before'] for r in rows if r['far']['after'] is not None]
    own = {'found': [r['found'] for r in rows], 'right_joint': [r['right_joint'] for r in rows],
           'wrong': [r['wrong'] for r in rows], 'far': far}  # fmt: skip
    tools = {'`sgp diagnose`': own}
    for tool, name in (
        ('lasso', 'Lasso'),
        ('stlsq', 'PySINDy'),
        ('operon', 'Operon'),
        ('process', 'Gaussian process'),
    ):
        tools[name] = {
            key: [r[tool][key] for r in others] for key in own if key in others[0][tool]
        }
    lines = []
    for name, found in tools.items():
        rates = [_share(statistics.fmean(found[key])) if key in found else 'none'
                 for key in ('found', 'right_joint', 'wrong')]  # fmt: skip
        worse = _share(statistics.fmean(x > 1.0 for x in found['far']))
        lines.append(f'| {name} | {" | ".join(rates)} | {_small(statistics.median(found["far"]))} '
                     f'| {worse} |')  # fmt: skip
    return '\n'.join(lines)


def _no_law():
    result = json.loads(NO_LAW.read_text(encoding='utf-8'))
    words = {'none': 'noise', 'parameters': 'wrong bodies', 'walk': 'a force that drifts in time',
             'all': 'all'}  # fmt: skip
    lines = []
    for kind, found in result['summary'].items():
        law, name = found['wrong_law'], found['wrong_name']
        lines.append(f'| {words[kind]} | {law["n"]} | {_count(law)} | {_count(name)} | '
                     f'{_share(name["high"])} |')  # fmt: skip
    return {'no_law': '\n'.join(lines), 'lawless_tier': result['tier'],
            'lawless_worlds': len(result['worlds']), 'lawless_numbers': result['numbers']}  # fmt: skip


def _tool_forces():
    result = json.loads(TOOL.read_text(encoding='utf-8'))
    summary, lines = result['summary'], []
    for r in result['cases']:
        law = 'none' if r['said'] is None else f'`{r["said"]}`'
        error = '' if r['error'] is None else f'{100.0 * r["error"]:.2g} %'
        others = ', '.join(f'{effect} on {joint}' for effect, joint in r['others'])
        word = 'found' if r['found'] else 'wrong' if r['wrong'] else ''
        lines.append(f'| {r["kind"]} | {r["joints"]} | {100.0 * r["share"]:.2g} % | {law} | {error} '
                     f'| {others} | {", ".join(r["unknown"])} | {word} |')  # fmt: skip
    inside = summary['with_a_formula']
    return {'tool_rows': '\n'.join(lines), 'tool_seeds': result['seeds'],
            'tool_worlds': summary['worlds'], 'tool_inside': inside,
            'tool_found': round(summary['found'] * inside),
            'tool_wrong': round(summary['wrong'] * summary['worlds'])}  # fmt: skip


def _count(found):
    return round(found['share'] * found['n'])


def _resonance(name, path):
    """Return the numbers of worlds with a resonance."""
    result = json.loads(path.read_text(encoding='utf-8'))
    words = {'all': 'all', 'below_half_the_rate': 'resonance below half the sampling rate'}
    lines = []
    for which, found in result['summary'].items():
        named, side = found['named'], found['right_side']
        error = next(x for key, x in found.items() if key.endswith('_error_median'))
        lines.append(
            f'| {words[which]} | {named["n"]} | {_share(named["share"])} ({_share(named["low"])} '
            f'to {_share(named["high"])}) | {_share(side["share"])} | '
            f'{_share(found["something_else"]["share"])} | '
            f'{_small(error)} |'
        )
    missed = [
        f'- {r["case"]}: `{r["verdict"]}`, resonance at {r["resonance_hz"]:.0f} Hz of '
        f'{r["rate_hz"]:.0f} Hz{_beside(r)}'
        for r in result['worlds'] if not r['is_named'] or r['others']
    ]  # fmt: skip
    return {
        name: '\n'.join(lines), f'{name}_worlds': len(result['worlds']),
        f'{name}_seeds': result['seeds'],
        f'{name}_missed': '\n'.join(['Missed, or with something else asserted:', '', *missed])
        if missed else 'None was missed.',
    }  # fmt: skip


def _beside(row):
    return ''.join(f', `{effect}` on `{joint}`' for effect, joint in row['others']) + '.'


def _machines():
    machines = json.loads(WITHHELD.read_text(encoding='utf-8'))['machines']
    lines = []
    for name, found in machines.items():
        lines.append(f'**{name}**, without {", ".join(f"`{e}`" for e in found["withheld"])}: '
                     f'`{found["verdict"]}`.')  # fmt: skip
        for s in found['searches']:
            best = s['formulas'][0]
            why = 'It is asserted.' if s['is_asserted'] else f'Not asserted: {s["why_not"]}.'
            lines.append(
                f'The force on `{s["joint"]}` {s["words"]}. A force without a formula leaves '
                f'{_small(s["left"])} of the mean squared effort, the effects that are still '
                f'listed {_small(s["left_by_listed"])}, and the best formula, '
                f'`{best["formula"]}`, {_small(best["left"])}. {why}'
            )
    return '\n'.join(lines)


def _small(x):
    return f'{100.0 * x:.2g} %'


def _share(x):
    return f'{100.0 * x:.0f} %'


def _failures(rows):
    lines = []
    for r in rows:
        if r['wrong']:
            said = ', '.join(
                [*(f'`{f}`' for f in r['formulas']), *(f'{e} of {j}' for e, j in r['listed'])]
            )
            is_right = bool(r['law_error']) and max(x or 1.0 for x in r['law_error']) <= SAME
            beside = (
                '; the law itself is right, but what is named beside it is not' if is_right else ''
            )
            lines.append(f'- `{r["kind"]}` ({r["case"]}): wrongly named {said}{beside}.')
    missed = sorted({r['kind'] for r in rows if not r['found'] and not r['wrong']})
    if missed:
        lines.append(
            f'- Not found, and nothing wrong named: {", ".join(f"`{k}`" for k in missed)}.'
        )
    return '\n'.join(lines) or '- It failed in none of these worlds.'


def _table(rows):
    lines = ['| family | worlds | found | wrong name | unexplained |', '|---|---|---|---|---|']
    for kind in dict.fromkeys(r['kind'] for r in rows):
        own = [r for r in rows if r['kind'] == kind]
        open_ = sum(r['verdict'] == 'unexplained' for r in own)
        lines.append(
            f'| `{kind}` | {len(own)} | {sum(r["found"] for r in own)} '
            f'| {sum(r["wrong"] for r in own)} | {open_} |'
        )
    return '\n'.join(lines)


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
