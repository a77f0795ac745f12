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
from sgp_ros.experiments.reproduction.catalogue import EXPERIMENTS, run_seed
from sgp_ros.experiments.reproduction.figures import draw_experiment
from sgp_ros.experiments.reproduction.protocol import METHOD_NAMES
from sgp_ros.report.figures import png
from sgp_ros.report.files import write_bytes, write_text
from sgp_ros.report.metrics import versions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from sgp_ros.experiments.reproduction.catalogue import Experiment
    from sgp_ros.experiments.reproduction.protocol import Outcome

GROUPS = ('toy', 'reaction-wheel', 'arm')
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
    if not chosen:
        raise ConfigError(f'experiment {group!r}', f'one of {[*GROUPS, "all"]}')
    if seeds is not None and seeds < 1:
        raise ConfigError(f'{seeds} seeds', 'at least one')
    numbers = {e.name: seeds or (e.quick_seeds if is_quick else e.seeds) for e in chosen}
    began = time.perf_counter()
    outcomes = _run_all(chosen, numbers, progress)
    results: dict[str, Any] = {
        'schema': SCHEMA,
        'seeds': max(numbers.values()),
        'experiments': {e.name: summary.summarise(outcomes[e.name]) for e in chosen},
        'seeds_of': numbers,
        'bad_seeds': {e.name: summary.bad_seeds(outcomes[e.name]) for e in chosen},
        'coefficient_errors': {
            e.name: summary.coefficient_errors(outcomes[e.name]) for e in chosen
        },
        'chosen_inputs': {e.name: summary.chosen_inputs(outcomes[e.name]) for e in chosen},
        'pit': {e.name: summary.calibration(outcomes[e.name]) for e in chosen},
        'versions': versions(),
        'seconds': round(time.perf_counter() - began, 1),
    }
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / 'results.json', json.dumps(results, indent=1, allow_nan=False) + '\n')
    table = '\n'.join(
        summary.markdown(e.title, results['experiments'][e.name], numbers[e.name]) for e in chosen
    )
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
    chosen: list[Experiment], numbers: dict[str, int], progress: Callable[[float], None]
) -> dict[str, dict[str, list[Outcome]]]:
    """Run every method on every seed, in as many processes as there are cores."""
    jobs = [
        (experiment.name, seed, method)
        for experiment in chosen
        for seed in range(numbers[experiment.name])
        for method in METHOD_NAMES
    ]
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
    return {
        experiment.name: {
            method: [
                found[experiment.name, seed, method] for seed in range(numbers[experiment.name])
            ]
            for method in METHOD_NAMES
        }
        for experiment in chosen
    }
