"""Write docs/diagnosis.md from the committed results: `python docs/generate_diagnosis.py`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from sgp_proof.concealed.scoring import rate
from sgp_ros.diagnosis.criteria import (
    ADEQUATE_REST,
    INDEPENDENT_ROWS,
    LEAST_SHARE,
    PER_EFFECT,
    PER_PARAMETER,
    SHAPE_ERROR,
)
from sgp_ros.physics.catalogue import PAYLOAD

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'diagnosis.md'
RESULTS = {
    name: ROOT / f'sgp_proof/results/concealed_{name}.json'
    for name in ('a', 'b', 'a_pair', 'b_pair')
    if (ROOT / f'sgp_proof/results/concealed_{name}.json').exists()
}
NULLS = [ROOT / f'sgp_proof/results/nulls_{tier}.json' for tier in ('a', 'b')]
LISTED, UNLISTED = 'one effect of the list', 'unlisted effect'
MACHINES = ROOT / 'sgp_proof/results/concealed_c.json'
PAPER = ROOT / 'sgp_proof/results/concealed_paper.json'
CANCELLING = ROOT / 'sgp_proof/results/cancelling.json'
SWINGS = ROOT / 'sgp_proof/results/swings.json'
TEMPLATE = Path(__file__).parent / 'templates' / 'diagnosis.txt'


def _percent(rate):
    if rate['share'] is None:
        return 'none drawn'
    return (
        f'{100 * rate["share"]:.0f} % of {rate["n"]} '
        f'({100 * max(rate["low"], 0.0) + 0.0:.0f} to {100 * rate["high"]:.0f} %)'
    )


def _number(value, scale=1.0, unit=''):
    return 'none' if value is None else f'{scale * value:.3g}{unit}'


def _tier(report):
    s = report['summary']
    pairs = ', pairs alone' if report.get('only') == 'pair' else ''
    lines = [
        f'\n### Tier {report["tier"]}{pairs}: {s["worlds"]} worlds, seeds {report["seeds"]}\n',
        '| | |', '|---|---|',
        f'| one effect: joint and effect right | {_percent(s["named_single"])} |',
        f'| pairs: top answer right | {_percent(s["named_pair_top"])} |',
        f'| pairs: single effects found | {_percent(s["components_of_pairs"])} |',
        f'| false alarms without missing physics | {_percent(s["false_alarms"])} |',
        (f'| unknown effects reported as unexplained, at the right joint | '
        f'{_percent(s["unknown_called_unexplained"])} |'),
        f'| overlap of localised effects, median | {_number(s["overlap_median"])} |',
        f'| parameter error, median | {_number(s["parameter_error_median"], 100, " %")} |',
        (f'| the same, for the fitted true structure | '
         f'{_number(s["oracle_parameter_error_median"], 100, " %")} |'),
        f'| truth within two standard deviations | {_percent(s["within_two_std"])} |',
    ]  # fmt: skip
    lines.append(
        f'| seconds per world on a busy machine, median | {_number(s["seconds_median"])} |'
    )
    lines.append(f'| commands that failed | {s["failed"]} |')
    lines += _improvement(s)
    lines += ['\n| stated certainty | right |', '|---|---|']
    lines += [
        f'| {band["from"]:g} to {band["to"]:g} | {_percent(band)} |' for band in s['probability']
    ]
    if s['confused']:
        lines += ['\n| hidden -> reported | worlds |', '|---|---|']
        lines += [f'| {what} | {count} |' for what, count in sorted(s['confused'].items())]
    return '\n'.join(lines) + '\n'


def _improvement(summary):
    """Return a table on what the diagnoses gain of what the true structure gains."""
    found = summary['improvement'].values()
    rows = {
        'share of the best possible improvement: median, mean, least': [
            _spread(f['of_oracle']) for f in found
        ],
        'the same for a model without error': [_spread(f['of_truth']) for f in found],
        'better than the fitted true structure': [_above(f) for f in found],
        'what the fitted true structure leaves of the nominal error, median': [
            _number(f['left_by_oracle_median'], 100, ' %') for f in found
        ],
        'not scored, because the fitted true structure improves hardly anything': [
            _cases(f['not_scored']) for f in found
        ],
        'share below 0.9': [_cases(f['below_nine_tenths']) for f in found],
    }
    head = ' | '.join(summary['improvement'])
    lines = [f'\n| accelerations held out | {head} |', '|---|---|---|']
    return [*lines, *(f'| {what} | {" | ".join(cells)} |' for what, cells in rows.items())]


def _above(found):
    count = f'{found["above"]} of {found["of_oracle"]["worlds"]}'
    return f'{count}, by {found["largest"] - 1.0:.1g} at most' if found['above'] else count


def _spread(found):
    if not found['worlds']:
        return 'none'
    numbers = ', '.join(f'{found[name]:.4f}' for name in ('median', 'mean', 'least'))
    return f'{numbers} of {found["worlds"]}'


def _cases(cases):
    return (
        ', '.join(f'{case.removeprefix("case_")} {what}' for case, what in cases.items()) or 'none'
    )


def _machines(report):
    """Return what is said of machines with many effects, the wrong worlds first."""
    s = report['summary']
    wrong = [case for case in report['cases'] if not case['right']]
    lines = [
        f'{s["worlds"]} worlds, seeds {report["seeds"]}; {len(wrong)} of them are not fully right:\n',
        '| world | asked for | missed | wrongly asserted | verdict |', '|---|---|---|---|---|',
    ]  # fmt: skip
    for case in wrong:
        spurious = [f'{e} of {j} ({p:.2f})' for e, j, p in case['wrong'] + case['unexplained']]
        missed = [f'{e} of {j}' for e, j in case['missed']]
        lines.append(
            f'| {case["case"].removeprefix("case_")} {case["key"].removeprefix("C_")} | '
            f'{len(case["named"]) + len(missed)} | {", ".join(missed) or "none"} | '
            f'{", ".join(spurious) or "none"} | {case["said"]} |'
        )
    held_out = s['held_out_of_oracle']
    rows = {
        'worlds fully right': _percent(s['right']),
        'the same, many effects hidden': _percent(s['right_hidden']),
        'the same, an unlisted law on top': _percent(s['right_unlisted']),
        'the same, no physics hidden': _percent(s['right_calm']),
        'false alarms where no physics is hidden': _percent(s['false_alarms']),
        'worlds with a wrong law asserted': _percent(s['confidently_wrong']),
        'worlds reported as unexplained although the list explains them': _percent(
            s['called_unexplained']
        ),
        'effects asked for that are named (recall)': _percent(s['recall']),
        'findings asserted that are right (precision)': _percent(s['precision']),
        'effects asked for in a world, median': _number(s['effects_asked_median']),
        'truth within two standard deviations': _percent(s['within_two_std']),
        'parameter error, median': _number(s['parameter_error_median'], 100, ' %'),
        'nMSE of the effort held out, relative to the true structure: median, largest': (
            f'{_number(held_out["median"])}, {_number(held_out["largest"])} of '
            f'{held_out["joints"]} joints'
        ),
        'joints within 1.3 times of it': _percent(held_out['within_1.3']),
        'seconds per world on a busy machine, median': _number(s['seconds_median']),
        'commands that failed': str(s['failed']),
    }
    lines += ['\n| | |', '|---|---|', *(f'| {what} | {cell} |' for what, cell in rows.items())]
    return '\n'.join(lines) + '\n'


PAPER_COLUMNS = (
    '| | worlds | top answer right | effects that count, found | others found | overlap | '
    'parameter error, median | truth within two standard deviations |'
)
PAPER_NAMES = {
    'pendulum': 'pendulum, 2 to 2.5 rad', 'wheel': 'wheel, viscous friction',
    'arm': 'arm, limits of joint 3',
}  # fmt: skip


def _paper(report):
    first, last = map(int, report['seeds'].split(':'))
    lines = [
        PAPER_COLUMNS,
        '|---|---|---|---|---|---|---|---|',
    ]
    for key, name in PAPER_NAMES.items():
        found = report['concealments'][key]
        s, cases = found['summary'], found['cases']
        right, count, named, beside = (
            sum(case[k] for case in cases)
            for k in ('right', 'counting', 'counting_found', 'spurious')
        )
        lines.append(
            f'| {name} | {len(cases)} of {last - first} seeds | {right} of {len(cases)} | '
            f'{named} of {count} | {beside} | {_number(s["overlap_median"])} | '
            f'{_number(s["parameter_error_median"], 100, " %")} | {_percent(s["within_two_std"])} |'
        )
    wrong = [
        f'* {PAPER_NAMES[key]}, {case["case"]}, tier {case["key"][0]}, {case["relative_size"]:g} of '
        f'the size, {100 * max(case["shares"]):.2g} % of the squared effort; found: '
        f'{", ".join(f"{e} of {j}" for e, j, _ in case["found"]) or case["said"]}.'
        for key in PAPER_NAMES
        for case in report['concealments'][key]['cases']
        if not case['right'] or case['spurious'] or case['counting_found'] < case['counting']
    ]
    if wrong:
        lines += ['\nAll worlds with an error in any of these columns:\n', *wrong]
    return '\n'.join(lines) + '\n'


def _nulls(worlds):
    """Return what the statistics of the verdict show where their null hypothesis holds."""
    lines = [
        '| world | number | false alarms | gain, 95 % | gain, largest | left, largest |',
        '|---|---|---|---|---|---|',
    ]
    calm = [w for w in worlds if w['kind'] not in {LISTED, UNLISTED}]
    for kind in dict.fromkeys(w['kind'] for w in calm):
        some = [w for w in calm if w['kind'] == kind]
        alarms = rate(w['verdict'] in {'missing_physics', 'unexplained'} for w in some)
        gains = [max([m['fit'] - w['base']['fit'] for m in w['models']], default=0.0)
                 for w in some]  # fmt: skip
        lines.append(
            f'| {kind} | {len(some)} | {_percent(alarms)} | {np.quantile(gains, 0.95):.1f} | '
            f'{max(gains):.1f} | {100 * max(w["left"] for w in some):.2g} % |'
        )
    alarms = rate(w['verdict'] in {'missing_physics', 'unexplained'} for w in calm)
    price = PER_EFFECT + PER_PARAMETER
    lines.append(
        f'\nIn total, {_percent(alarms)} are false alarms. The smallest penalty of an effect is '
        f'{price:g} nats. The verdict `unexplained` requires that {100 * LEAST_SHARE:g} % is left.'
    )
    return '\n'.join(lines)


def _effects(worlds):
    """Return lines of the table on worlds with one effect, of the list or not."""
    of_list = [w for w in worlds if w['kind'] == LISTED and w['extra'] != PAYLOAD.name]
    listed = [w for w in of_list if 'right' in w]
    unlisted = [w for w in worlds if w['kind'] == UNLISTED]
    rests = [w['right_structured_rest'] for w in listed]
    others = [w['structured_rest'] for w in unlisted if w['structured_rest'] is not None]
    rows = [
        ('gain of a superfluous effect [nats]', _gains(listed, 'superfluous'),
         f'{PER_EFFECT:g} per effect and {PER_PARAMETER:g} per parameter'),
        ('gain of a richer law [nats]', _gains(listed, 'richer'),
         f'{PER_PARAMETER:g} per additional parameter'),
        ('structure left by the right model', rests, f'at most {ADEQUATE_REST:g}'),
        ('structure left by the best model of an unlisted effect', others,
         f'more than {ADEQUATE_REST:g}'),
    ]  # fmt: skip
    lines = [
        '| statistic | worlds | 5 % | median | 95 % | largest | threshold |',
        '|---|---|---|---|---|---|---|',
    ]
    for name, values, asked in rows:
        low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
        lines.append(
            f'| {name} | {len(values)} | {low:.2g} | {middle:.2g} | {high:.2g} | '
            f'{max(values):.2g} | {asked} |'
        )
    passed = rate(r < ADEQUATE_REST for r in rests)
    refused = rate(r > ADEQUATE_REST for r in others)
    nearly = rate(r < SHAPE_ERROR for r in rests)
    missing = len(of_list) - len(listed)
    lines.append(
        f'\nThe right model is adequate in {_percent(passed)}; the best model is rejected for an unlisted effect in '
        f'{_percent(refused)}. The table omits {missing} worlds with one listed effect, '
        'because the right model was not among those fitted.\n\n'
        f'Filters and signals have errors, so models are compared as if the right physics column left '
        f'{100 * SHAPE_ERROR:g} % of the discrepancy. {_percent(nearly)} of the right models leave less structure. '
        f'At most {INDEPENDENT_ROWS:g} rows count. Only the ratio of this number to the penalties matters; the '
        'table shows the gains under the null hypothesis.'
    )
    return lines


def _gains(worlds, name):
    return [max(w[name]['gain'], 0.0) if w[name] else 0.0 for w in worlds]


def _cancelling(report):
    """Return what is named where large forces cancel, by what was concealed, and wrong names."""
    count = report['summary']
    lines = [
        '| hidden | worlds | right names, before | any wrong name, before |',
        '|---|---|---|---|',
    ]
    kinds = dict.fromkeys(w['kind'] for w in report['worlds'])
    for kind in kinds:
        cells = [f'{count[f"{kind}: {what}"]}, {count[f"{kind}: {what} before"]}'
                 for what in ('right', 'wrong')]  # fmt: skip
        lines.append(f'| {kind} | {count[kind]} | {" | ".join(cells)} |')
    wrong = [w for w in report['worlds'] if w['is_wrong']]
    if wrong:
        lines += ['\nWrong names:\n']
    for w in wrong:
        named = ', '.join(f'{name} ({p:.2f})' for name, _, _, p in w['named'])
        lines.append(f'* world {w["seed"]}, {w["concealed"]}: {named}')
    return '\n'.join(lines)


def _swings(report):
    """Return what is said of free swings, by what takes their energy, and wrong names."""
    lines = [
        '| hidden | worlds | right | a wrong name | "nothing is missing", with a certainty |',
        '|---|---|---|---|---|',
    ]
    for kind in dict.fromkeys(w['kind'] for w in report['worlds']):
        some = [w for w in report['worlds'] if w['kind'] == kind]
        counts = [sum(w[f'is_{what}'] for w in some) for what in ('right', 'wrong', 'denied')]
        lines.append(
            f'| {kind.replace("_", " ")} | {" | ".join(map(str, [len(some), *counts]))} |'
        )
    bad = [w for w in report['worlds'] if w['is_wrong'] or w['is_denied']]
    lines += ['\nWorlds that are named wrongly, or said to lack nothing:\n'] if bad else []
    for w in bad:
        named = ', '.join(f'{n} of {joint} ({p:.2f})' for n, joint, _, p in w['named'])
        lost = ', '.join(f'{x:.2f}' for x in w['lost'])
        lines.append(
            f'* world {w["seed"]}, {w["kind"]}, {w["joints"]} links, energy lost {lost}: '
            f'{named or w["verdict"]}'
        )
    return '\n'.join(lines).replace('_', ' ')


def text():
    """Return the page."""
    reports = [json.loads(path.read_text(encoding='utf-8')) for path in RESULTS.values()]
    nulls = [w for path in NULLS for w in json.loads(path.read_text(encoding='utf-8'))['worlds']]
    cancelling = json.loads(CANCELLING.read_text(encoding='utf-8'))
    swings = json.loads(SWINGS.read_text(encoding='utf-8'))
    parts = {
        'tiers': ''.join(map(_tier, reports)),
        'machines': _machines(json.loads(MACHINES.read_text(encoding='utf-8'))),
        'paper': _paper(json.loads(PAPER.read_text(encoding='utf-8'))),
        'nulls': _nulls(nulls),
        'effects': '\n'.join(_effects(nulls)),
        'cancelling': _cancelling(cancelling),
        'cancelling_seeds': '{}:{}'.format(*cancelling['seeds']),
        'swings': _swings(swings),
        'swings_seeds': '{}:{}'.format(*swings['seeds']),
    }
    page = TEMPLATE.read_text(encoding='utf-8')
    for name, part in parts.items():
        page = page.replace(f'{{{name}}}', part)
    return page


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
