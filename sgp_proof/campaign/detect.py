"""How soon wear is found, how often what never changed: `python -m sgp_proof.campaign.detect`.

Campaigns of a thousand drawn results (see `wear.py`) are looked at as they grow. Only what a real
campaign would know is given: estimates, intervals and stamps.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from sgp_proof.campaign.wear import QUANTITIES, WORN, World, draw_results, measured
from sgp_proof.result_files import make_parser, write_result
from sgp_ros.campaign.changes import FALSE_ALARMS
from sgp_ros.campaign.trends import WARM_UP, find_trends

WORLDS = {
    'at once': World(),
    'at once, twice the spread from day to day': World(day=0.02),
    'over 20 recordings': World(ramp=20),
}
LOOKS = (10, 20, 40)
NULL_LOOKS = (50, 200, 1000)
FIRST, LAST = 200, 950
"""Recordings at which the growth may begin."""


def looked_at(results):
    """Return the quantities that changed, by joint and parameter, and all trends."""
    trends = {(t.key[1], t.key[3].partition('.')[2]): t for t in find_trends(results)}
    return {key for key, t in trends.items() if t.changes or t.is_drift}, trends


def detection(world, seeds):
    """Return how many campaigns show the wear so many recordings after it began."""
    found = dict.fromkeys(LOOKS, 0)
    others, held, sizes, count = 0, 0, 0, 0
    for seed in range(seeds):
        begin = int(np.random.default_rng(10_000 + seed).integers(FIRST, LAST))
        results = draw_results(world, seed, begin)
        for look in LOOKS:
            changed, trends = looked_at(results[: begin + look])
            found[look] += WORN in changed
            others += bool(changed - {WORN})
        for change in trends[WORN].changes[:1]:
            count += 1
            held += change.first <= f'{begin:04d}.mcap' <= change.last
            sizes += change.low <= world.growth * 0.3 <= change.high
    return {
        'world': asdict(world), 'campaigns': seeds,
        'found_after': {str(k): n for k, n in found.items()},
        'looks_with_a_false_one': others, 'looks': seeds * len(LOOKS),
        'told_at_the_last_look': count, 'place_held': held, 'size_held': sizes,
    }  # fmt: skip


def without_change(seeds):
    """Return how many campaigns without a change raise an alarm, and how often intervals hold."""
    alarms, chances, slopes, warm_ups = 0, [], [], []
    world = World()
    for seed in range(seeds):
        results = draw_results(world, 100_000 + seed)
        looks = [looked_at(results[:n]) for n in NULL_LOOKS]
        alarms += any(changed for changed, _ in looks)
        chances.append(min(t.chance for _, trends in looks for t in trends.values()))
        for trend in looks[-1][1].values():
            terms = {term.name: term for term in trend.terms}
            if 'per day' in terms:
                slopes.append(terms['per day'].low <= 0.0 <= terms['per day'].high)
            warm_ups.append(terms[WARM_UP].low <= world.warm_up * 0.3 <= terms[WARM_UP].high)
    return {
        'campaigns': seeds, 'looks_each': list(NULL_LOOKS), 'quantities': len(QUANTITIES),
        'bound': FALSE_ALARMS, 'with_an_alarm': alarms,
        'chance_at_most': {f'{p:g}': int(sum(c <= p for c in chances)) for p in (0.5, 0.2, 0.1)},
        'slope_interval_holds': float(np.mean(slopes)), 'slopes': len(slopes),
        'warm_up_interval_holds': float(np.mean(warm_ups)), 'warm_ups': len(warm_ups),
    }  # fmt: skip


def main():
    """Measure and write."""
    parser = make_parser(__doc__, 'campaign', [*WORLDS, 'without change'])
    parser.add_argument('--campaigns', type=int, default=20)
    arguments = parser.parse_args()
    for name in arguments.names:
        if name in WORLDS:
            done = detection(replace(WORLDS[name]), arguments.campaigns)
        else:
            done = without_change(arguments.campaigns)
        kept = measured(arguments.out)
        kept.setdefault('detection', {})[name] = done
        write_result(arguments.out, kept)
        print(name, done, flush=True)


if __name__ == '__main__':
    main()
