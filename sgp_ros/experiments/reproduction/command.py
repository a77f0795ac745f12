"""`sgp reproduce`: the paper's experiments, tables and figures."""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import TYPE_CHECKING, Any

from sgp_ros.errors import ConfigError
from sgp_ros.experiments.reproduction import summary
from sgp_ros.experiments.reproduction.catalogue import (
    CHOICE_SEEDS,
    COMPARED,
    EXPERIMENTS,
    QUICK_CHOICE_SEEDS,
    run_seed,
)
from sgp_ros.experiments.reproduction.choices import CHOICES
from sgp_ros.experiments.reproduction.figures import draw_experiment
from sgp_ros.experiments.reproduction.protocol import METHOD_NAMES
from sgp_ros.report.figures import png
from sgp_ros.report.files import write_bytes, write_text
from sgp_ros.report.metrics import versions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from sgp_ros.experiments.reproduction.protocol import Outcome

GROUPS = ('toy', 'reaction-wheel', 'arm', 'choices')
SCHEMA = 1


def run_reproduction(
    group: str,
    seeds: int | None,
    out: Path,
    progress: Callable[[float], None],
    *,
    is_quick: bool = False,
) -> dict[str, Any]:
    """Run the experiments of a group and write results.json, table.md and the figures.

    Args:
        group: one of `GROUPS`, or `all`.
        seeds: worlds per experiment; None for the usual number.
        out: folder of the results.
        progress: called with the share that is done.
        is_quick: few seeds, for a check in a minute or two.

    Raises:
        ConfigError: no such group, or less than one seed.
    """
    chosen = [e for e in EXPERIMENTS.values() if group in ('all', e.group)]
    with_choices = group in ('all', 'choices')
    if not chosen and not with_choices:
        raise ConfigError(f'experiment {group!r}', f'one of {[*GROUPS, "all"]}')
    if seeds is not None and seeds < 1:
        raise ConfigError(f'{seeds} seeds', 'at least one')
    numbers = {e.name: seeds or (e.quick_seeds if is_quick else e.seeds) for e in chosen}
    began = time.perf_counter()
    jobs = [
        (e.name, seed, method)
        for e in chosen
        for seed in range(numbers[e.name])
        for method in METHOD_NAMES
    ]
    compared = min(seeds or CHOICE_SEEDS, QUICK_CHOICE_SEEDS if is_quick else CHOICE_SEEDS)
    if with_choices:
        jobs += [(n, seed, c) for n in COMPARED for seed in range(compared) for c in CHOICES]
    found = _run_all(jobs, progress)
    outcomes = {e.name: _of_seeds(found, e.name, METHOD_NAMES, numbers[e.name]) for e in chosen}
    choices = {
        name: summary.summarise(_of_seeds(found, name, tuple(CHOICES), compared))
        for name in COMPARED
        if with_choices
    }
    results: dict[str, Any] = {
        'schema': SCHEMA,
        'seeds': max([*numbers.values(), compared]),
        'experiments': {e.name: summary.summarise(outcomes[e.name]) for e in chosen},
        'seeds_of': numbers,
        'bad_seeds': {e.name: summary.bad_seeds(outcomes[e.name]) for e in chosen},
        'coefficient_errors': {
            e.name: summary.coefficient_errors(outcomes[e.name]) for e in chosen
        },
        'chosen_inputs': {e.name: summary.chosen_inputs(outcomes[e.name]) for e in chosen},
        'pit': {e.name: summary.calibration(outcomes[e.name]) for e in chosen},
        'choices': choices,
        'choices_seeds': compared,
        'versions': versions(),
        'seconds': round(time.perf_counter() - began, 1),
    }
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / 'results.json', json.dumps(results, indent=1, allow_nan=False) + '\n')
    table = '\n'.join(
        summary.markdown(e.title, results['experiments'][e.name], numbers[e.name]) for e in chosen
    )
    for name, found_choices in choices.items():
        table += '\n' + summary.markdown(f'Choices on {name}', found_choices, compared)
    write_text(out / 'table.md', table)
    for experiment in chosen:
        figures = draw_experiment(
            experiment, outcomes[experiment.name], results['experiments'][experiment.name]
        )
        for name, figure in figures.items():
            write_bytes(out / f'{name}.png', png(figure))
    print(table)
    print(f'{results["seconds"]} s; results in {out}')
    return results


def _run_all(
    jobs: list[tuple[str, int, str]], progress: Callable[[float], None]
) -> dict[tuple[str, int, str], Outcome]:
    """Run all jobs in as many processes as there are cores."""
    found: dict[tuple[str, int, str], Outcome] = {}
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(max_workers=os.cpu_count() or 1, mp_context=context) as pool:
        futures = {pool.submit(run_seed, *job): job for job in jobs}
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                found[futures[future]] = future.result()
                progress(done / len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return found


def _of_seeds(
    found: dict[tuple[str, int, str], Outcome], name: str, methods: tuple[str, ...], seeds: int
) -> dict[str, list[Outcome]]:
    return {method: [found[name, seed, method] for seed in range(seeds)] for method in methods}
