"""`sgp reproduce`: the paper's experiments, tables and figures."""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgp_proof.paper import summary
from sgp_proof.paper.catalogue import (
    CHOICE_SEEDS,
    COMPARED,
    EXPERIMENTS,
    QUICK_CHOICE_SEEDS,
    Experiment,
    run_compared,
    run_seed,
)
from sgp_proof.paper.figures import draw_experiment
from sgp_proof.paper.protocol import METHOD_NAMES, Outcome
from sgp_ros.errors import ConfigError
from sgp_ros.report.figures import png
from sgp_ros.report.files import replacing_results, write_bytes, write_text
from sgp_ros.report.metrics import versions

Runner = Callable[..., dict[str, Outcome]]
Job = tuple[Runner, str, int] | tuple[Runner, str, int, str]

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
    plan = _plan(group, seeds, is_quick=is_quick)
    began = time.perf_counter()
    found = _run_all(plan.jobs(), progress)
    outcomes = {e.name: _of_seeds(found, run_seed, e.name) for e in plan.chosen}
    choices = {
        name: summary.summarise(_of_seeds(found, run_compared, name))
        for name in COMPARED
        if plan.choice_seeds
    }
    results = {
        'schema': SCHEMA,
        'seeds': max([*plan.seeds.values(), plan.choice_seeds]),
        'experiments': {name: summary.summarise(runs) for name, runs in outcomes.items()},
        'seeds_of': plan.seeds,
        'bad_seeds': {name: summary.bad_seeds(runs) for name, runs in outcomes.items()},
        'behind_physics': {name: summary.behind_physics(runs) for name, runs in outcomes.items()},
        'not_best': {name: summary.not_best(runs) for name, runs in outcomes.items()},
        'coefficient_errors': {
            name: summary.coefficient_errors(runs) for name, runs in outcomes.items()
        },
        'chosen_inputs': {name: summary.chosen_inputs(runs) for name, runs in outcomes.items()},
        'pit': {name: summary.calibration(runs) for name, runs in outcomes.items()},
        'choices': choices,
        'choices_seeds': plan.choice_seeds,
        'versions': versions(),
        'seconds': round(time.perf_counter() - began, 1),
    }
    with replacing_results(out, 'reproduce'):
        _write(plan, outcomes, results, out)
    return results


@dataclass(frozen=True, slots=True)
class _Plan:
    """Experiments and seeds to run.

    Attributes:
        chosen: experiments.
        seeds: worlds per experiment.
        choice_seeds: worlds on which the choices are compared; 0 for none.
    """

    chosen: tuple[Experiment, ...]
    seeds: dict[str, int]
    choice_seeds: int

    def jobs(self) -> list[Job]:
        """Return every run: what to call with which experiment, seed and choice.

        The last experiments take longest, so they come first.
        """
        jobs: list[Job] = []
        for e in reversed(self.chosen):
            jobs += [(run_seed, e.name, seed) for seed in range(self.seeds[e.name])]
        for name, labels in COMPARED.items():
            for seed in range(self.choice_seeds):
                jobs += [(run_compared, name, seed, label) for label in labels]
        return jobs


def _plan(group: str, seeds: int | None, *, is_quick: bool) -> _Plan:
    chosen = tuple(e for e in EXPERIMENTS.values() if group in ('all', e.group))
    with_choices = group in ('all', 'choices')
    if not chosen and not with_choices:
        raise ConfigError(f'experiment {group!r}', f'one of {[*GROUPS, "all"]}')
    if seeds is not None and seeds < 1:
        raise ConfigError(f'{seeds} seeds', 'at least one')
    most = QUICK_CHOICE_SEEDS if is_quick else CHOICE_SEEDS
    return _Plan(
        chosen,
        {e.name: seeds or (e.quick_seeds if is_quick else e.seeds) for e in chosen},
        min(seeds or most, most) if with_choices else 0,
    )


def _write(
    plan: _Plan,
    outcomes: dict[str, dict[str, list[Outcome]]],
    results: dict[str, Any],
    out: Path,
) -> None:
    """Write results.json, table.md and the figures."""
    write_text(out / 'results.json', json.dumps(results, indent=1, allow_nan=False) + '\n')
    table = '\n'.join(
        [
            summary.markdown(e.title, results['experiments'][e.name], plan.seeds[e.name])
            for e in plan.chosen
        ]
        + [
            summary.markdown(f'Choices on {name}', found, plan.choice_seeds)
            for name, found in results['choices'].items()
        ]
    )
    write_text(out / 'table.md', table)
    for experiment in plan.chosen:
        figures = draw_experiment(
            experiment, outcomes[experiment.name], results['experiments'][experiment.name]
        )
        for name, figure in figures.items():
            write_bytes(out / f'{name}.png', png(figure))
    print(table)
    print(f'{results["seconds"]} s; results in {out}')


def _run_all(jobs: list[Job], progress: Callable[[float], None]) -> dict[Job, dict[str, Outcome]]:
    """Run all jobs in as many processes as there are cores."""
    found: dict[Job, dict[str, Outcome]] = {}
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(max_workers=os.cpu_count() or 1, mp_context=context) as pool:
        futures = {pool.submit(*job): job for job in jobs}
        try:
            for done, future in enumerate(as_completed(futures), start=1):
                found[futures[future]] = future.result()
                progress(done / len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return found


def _of_seeds(
    found: dict[Job, dict[str, Outcome]], run: Runner, name: str
) -> dict[str, list[Outcome]]:
    """Return outcomes by label, in the order of seeds."""
    runs: dict[str, dict[int, Outcome]] = {}
    for job, outcomes in found.items():
        if job[:2] == (run, name):
            for label, outcome in outcomes.items():
                runs.setdefault(label, {})[job[2]] = outcome
    order = METHOD_NAMES if run is run_seed else tuple(COMPARED[name])
    return {label: [runs[label][seed] for seed in sorted(runs[label])] for label in order}
