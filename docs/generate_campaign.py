"""Write docs/campaign.md from the committed results: `python docs/generate_campaign.py`."""

from __future__ import annotations

import json
from pathlib import Path

from sgp_proof.campaign.detect import FIRST, LAST, WORLDS
from sgp_ros.campaign.changes import EQUIVALENT_TESTS, FALSE_ALARMS, HORIZON
from sgp_ros.gp.scores import INTERVAL_95

ROOT = Path(__file__).parents[1]
TARGET = Path(__file__).parent / 'campaign.md'
NOT_YET = 'Not measured yet.'
TEMPLATE = Path(__file__).parent / 'templates' / 'campaign.txt'


def _detection(found):
    looks = list(next(iter(found.values()))['found_after'])
    head = ' | '.join(f'within {look}' for look in looks)
    lines = [
        f'| growth | {head} | interval contains the place | interval contains the size | looks with a false change |',
        '|---|' + '---|' * (len(looks) + 3),
    ]
    for name, x in found.items():
        each = ' | '.join(str(x['found_after'][look]) for look in looks)
        named = x['told_at_the_last_look']
        lines.append(
            f'| {name} | {each} | {x["place_held"]} of {named} | {x["size_held"]} of {named} | '
            f'{x["looks_with_a_false_one"]} of {x["looks"]} |'
        )
    return '\n'.join(lines)


def _waiting(found):
    lines = [
        f'| workers | tasks of {found["task_s"]:g} s | seconds | without any overhead | processor time of scheduler and client | load of the computer |',
        '|---|---|---|---|---|---|',
    ]
    for n, x in found['workers'].items():
        tasks = int(n) * found['tasks_per_worker']
        lines.append(
            f'| {n} | {tasks} | {x["seconds"]:.1f} | {x["ideal"]:.1f} | '
            f'{x["scheduler_ms_per_task"]:.1f} ms per task | {x["load_before"]:.1f} |'
        )
    return '\n'.join(lines)


def _speed(found):
    one, two = found['1'], found['2']
    return (
        f'**Speed.** With `identify` on recordings of a linear axis, one worker processes {one["recordings_per_s"]:.2f} recordings a '
        f'second and two workers {two["recordings_per_s"]:.2f}, a ratio of {found["ratio"]:.2f} (target 1.8: '
        f'{"met" if found["ratio"] >= 1.8 else "**missed**"}). The computer has two cores, which scheduler and writer share '
        'with the workers; it was otherwise idle.'
    )


def _kills(found):
    same = (
        'is identical to the byte to that of an undisturbed run'
        if found['same_table']
        else 'differs'
    )
    return (
        f'In a campaign of {found["recordings"]} recordings on two workers, {found["killed_workers"]} workers and '
        f'{found["killed_runs"]} whole runs were killed (SIGKILL) at random moments. Its `results.parquet` {same}.'
    )


def _workers(result):
    parts = []
    if 'waiting' in result:
        busy = 8e-1 * result['waiting']['workers']['8']['scheduler_ms_per_task']
        parts += [
            (
                'Tasks that only wait show the overhead of distributing them, with any number of workers. Everything runs on the\n'
                'two cores of an otherwise idle computer; the load is the mean of the minute before:'
            ),
            _waiting(result['waiting']),
            (
                'With eight workers and recordings that take one second each, scheduler and client would be busy for '
                f'{busy:.0f} % of\nthe time.'
            ),
        ]
    if 'speed' in result:
        parts.append(_speed(result['speed']))
    if 'kills' in result:
        parts.append('**Kills.** ' + _kills(result['kills']))
    return '\n\n'.join(parts) or NOT_YET


def text() -> str:
    """Return the page."""
    result = json.loads((ROOT / 'sgp_proof/results/campaign.json').read_text(encoding='utf-8'))
    found = {name: result['detection'][name] for name in WORLDS if name in result['detection']}
    nulls, alarms, machine = (
        result['detection']['without change'],
        result['alarms'],
        result['environment'],
    )
    world = found['at once']['world']
    halves = [100 * INTERVAL_95 * std for std in world['std']]
    values = {
        'MACHINE': f'{machine["processor"]}, Python {machine["python"]}, NumPy {machine["numpy"]}',
        'WARM_UP': f'{100 * world["warm_up"]:g}', 'TAU': f'{60 * world["tau_h"]:g}',
        'DAY': f'{100 * world["day"]:g}', 'SCATTER': f'{100 * world["scatter"]:g}',
        'LOW': f'{halves[0]:.0f}', 'HIGH': f'{halves[1]:.0f}', 'GROWTH': f'{100 * world["growth"]:g}',
        'FIRST': FIRST, 'LAST': LAST, 'BOUND': f'{100 * FALSE_ALARMS:g}',
        'CAMPAIGNS': found['at once']['campaigns'], 'DETECTION': _detection(found),
        'NULLS': nulls['campaigns'], 'NULL_LOOKS': ', '.join(map(str, nulls['looks_each'])),
        'ALARMS': nulls['with_an_alarm'], 'SLOPE': f'{100 * nulls["slope_interval_holds"]:.1f}',
        'WARM': f'{100 * nulls["warm_up_interval_holds"]:.1f}', 'HORIZON': HORIZON,
        'TESTS': f'{max(x["tests"] for x in alarms["levels"].values()):.0f}',
        'SERIES': alarms['series'], 'USED': f'{EQUIVALENT_TESTS:.0f}',
        'WORKERS': _workers(result),
    }  # fmt: skip
    page = TEMPLATE.read_text(encoding='utf-8')
    for name, value in values.items():
        page = page.replace(f'{{{name}}}', str(value))
    return page


def main() -> None:
    """Write it."""
    TARGET.write_text(text(), encoding='utf-8')


if __name__ == '__main__':
    main()
