"""Tasks on Dask distributed: on the cores of this computer, or on a cluster that runs already.

A task whose worker is lost is given to another one by Dask. What this module adds is one line in
place of a traceback for each task that fails.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from sgp_ros import __version__
from sgp_ros.errors import ConfigError
from sgp_ros.optional import optional_package

MOST_LOST_WORKERS = 10
"""Workers that one recording may take with it, for instance for want of memory, before it is given
up; of a local cluster."""
_CONNECT_S = 10
_EXTRA = 'campaign'

Task = Callable[[Mapping[str, Any]], dict[str, Any]]


@contextmanager
def cluster(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Give a Dask client; a local cluster ends with it.

    Args:
        scheduler: address of a cluster that runs; None for one of this computer.
        workers: processes of a local cluster; None for one a core.

    Raises:
        ConfigError: Dask is missing, nobody answers, or the workers have another version.
    """
    dask = optional_package('distributed', 'to spread a campaign over processes', _EXTRA)
    config = optional_package('dask', 'to spread a campaign over processes', _EXTRA).config
    with ExitStack() as stack:
        if scheduler is None:
            stack.enter_context(config.set({
                'distributed.scheduler.allowed-failures': MOST_LOST_WORKERS,
                'distributed.worker.multiprocessing-method': 'spawn',
            }))  # fmt: skip
            scheduler = stack.enter_context(dask.LocalCluster(
                n_workers=workers or len(os.sched_getaffinity(0)), threads_per_worker=1,
                processes=True, dashboard_address=None, silence_logs='CRITICAL',
            ))  # fmt: skip
        try:
            client = stack.enter_context(dask.Client(scheduler, timeout=_CONNECT_S))
        except (OSError, ValueError) as error:
            raise ConfigError(
                f'no Dask scheduler at {scheduler} ({error})', 'an address such as tcp://host:8786',
                'start one with `dask scheduler`, or leave out --scheduler',
            ) from error  # fmt: skip
        _require_version(client)
        yield client


def worker_version() -> str:
    """Return the version of this package, of the process that is asked."""
    return __version__


def _require_version(client: Any) -> None:
    """Refuse workers whose results would be those of another version."""
    try:
        versions = set(client.run(worker_version).values())
    except ImportError as error:
        raise ConfigError(
            f'workers cannot import sgp_ros ({error})', 'sgp_ros on every worker'
        ) from error
    if versions - {__version__}:
        raise ConfigError(
            f'workers with sgp_ros {sorted(versions)}', f'{__version__} on every worker'
        )


def run_tasks(
    client: Any, task: Task, jobs: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[int, dict[str, Any] | str]]:
    """Run a task for each job; yield the job's number with the result, as they come.

    What the task raises, or why its workers were lost, comes in place of a result, in one line.

    Args:
        client: of `cluster`.
        task: a function of a module, called in any worker, perhaps more than once.
        jobs: its arguments.
    """
    dask = optional_package('distributed', 'to spread a campaign over processes', _EXTRA)
    futures = {client.submit(task, job, pure=False): i for i, job in enumerate(jobs)}
    for future in dask.as_completed(list(futures)):
        i = futures.pop(future)
        error = future.exception()
        if error is None:
            yield i, future.result()
        else:
            yield i, ' '.join(f'{type(error).__name__}: {error}'.split())[:500]
        future.release()
