"""`sgp campaign`: diagnose and identify each of many recordings, then look at them together."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgp_ros import __version__
from sgp_ros.apps.campaign_task import examine_recording
from sgp_ros.apps.terminal import mark_folder, strong, warned
from sgp_ros.campaign.changes import FALSE_ALARMS
from sgp_ros.campaign.cluster import cluster, run_tasks
from sgp_ros.campaign.recordings import TableRow, find_recordings, read_covariates
from sgp_ros.campaign.table import (
    COLUMNS,
    RUN_COLUMNS,
    parquet_bytes,
    require_parquet,
    result_rows,
    run_rows,
)
from sgp_ros.campaign.trends import find_trends
from sgp_ros.errors import ConfigError
from sgp_ros.report.campaign import render_campaign, trend_sentences
from sgp_ros.report.files import replacing_results, write_bytes, write_text
from sgp_ros.report.next_steps import after_campaign, next_lines
from sgp_ros.robots.models.door import is_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import urdf_text

TASKS = {'both': ('diagnose', 'identify'), 'diagnose': ('diagnose',), 'identify': ('identify',)}
RESULTS = 'recordings'
"""Folder of the finished recordings, one JSON file each."""
_SCHEMA = 1


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """Options of a campaign: the task for each recording, and the table of all.

    Attributes:
        task: of `TASKS`.
        sim: recording or model file that every recording is compared with; None for the robot.
        gains: YAML file of the gains of drives whose commands are positions.
        joint_states, command, effort: as of the other commands.
        covariates: table with a column `recording`; None for none.
        topics: of numbers whose mean over each recording is a covariate.
    """

    task: str = 'both'
    sim: str | None = None
    gains: str | None = None
    joint_states: str | None = None
    command: str | None = None
    effort: str = 'auto'
    covariates: str | None = None
    topics: Sequence[str] = ()

    def of_task(self, task: str) -> dict[str, Any]:
        """Return the options of the command of that name; files by their whole path."""
        common = {'joint_states': self.joint_states, 'command': self.command,
                  'effort': self.effort}  # fmt: skip
        if task == 'identify':
            return common
        files = {'sim': self.sim, 'gains': self.gains}
        return common | {k: x and os.path.realpath(x) for k, x in files.items()}


def run_campaign(
    bag: Sequence[str], robot: str, out: Path, *, progress: Callable[[float], None],
    scheduler: str | None = None, workers: int | None = None, **options: Any,
) -> dict[str, Any]:  # fmt: skip
    """Examine all recordings that are not finished yet; write tables and the index.

    Args:
        bag: recordings, folders of them, or patterns.
        robot: built-in name, robot YAML or model file.
        out: folder of the results; what is finished there is not computed again.
        progress: called with the share that is done.
        scheduler: address of a Dask cluster; None for one of this computer.
        workers: processes of a local cluster; None for one a core.
        options: fields of `CampaignOptions`.

    Raises:
        ConfigError: a robot, table or cluster that cannot be used.
        RecordingError: no recording there.
    """
    require_parquet()
    chosen = CampaignOptions(**options)
    remarks: list[str] = []
    found = find_recordings(bag)
    table = read_covariates(chosen.covariates, tuple(found), remarks)
    jobs = _jobs(found, robot, chosen)
    if (out / RESULTS).is_symlink():
        raise ConfigError(f'{out / RESULTS} is a link', 'a plain folder', 'remove the link')
    (out / RESULTS).mkdir(parents=True, exist_ok=True)
    mark_folder(out, 'campaign')  # an interrupted run has left its sign
    with replacing_results(out, 'campaign'):
        open_jobs = [job for job in jobs if not _is_finished(out, job)]
        print(f'{len(jobs)} recordings, {len(jobs) - len(open_jobs)} of them finished before')
        broken = _compute(out, open_jobs, scheduler, workers, progress)
        results = [_result(out, job, table[job['recording']], broken) for job in jobs]
        remarks += [f'{r["recording"]}: {x}' for r in results for x in r.get('remarks', ())]
        content = write_campaign(out, results, remarks)
    _print_summary(content, out)
    progress(1.0)
    return content


def _jobs(found: Mapping[str, Path], robot: str, options: CampaignOptions) -> list[dict[str, Any]]:
    """Return what a worker has to know of each recording; a bad robot is refused here."""
    model = load_robot(robot)
    place = os.path.realpath(robot) if Path(robot).is_file() else robot
    text = urdf_text(model) if 'urdf' in model.source else ''
    arguments = {task: options.of_task(task) for task in TASKS[options.task]}
    files = [x for x in (options.sim, options.gains) if x is not None]
    for file in files:
        if not Path(file).exists():
            raise ConfigError(f'no file at {file}', 'a file', 'check the path')
    same = [_SCHEMA, __version__, place, text, dict(model.source), arguments, options.topics,
            [_state(Path(file)) for file in files]]  # fmt: skip
    jobs = []
    for name, path in found.items():
        said = json.dumps([*same, name, _state(path)], sort_keys=True, default=str).encode()
        jobs.append({
            'recording': name, 'path': str(path), 'robot': place, 'arguments': arguments,
            'topics': list(options.topics), 'fingerprint': hashlib.sha256(said).hexdigest(),
        })  # fmt: skip
    return jobs


def _state(path: Path) -> Any:
    """Return what changes with the content of a recording, or of a model file the content."""
    if is_model(str(path)):
        return hashlib.sha256(path.read_bytes()).hexdigest()
    files = sorted(path.rglob('*')) if path.is_dir() else [path]
    stats = [file.stat() for file in files]
    return [[file.name, s.st_size, s.st_mtime_ns] for file, s in zip(files, stats, strict=True)]


def _compute(
    out: Path, jobs: Sequence[Mapping[str, Any]], scheduler: str | None, workers: int | None,
    progress: Callable[[float], None],
) -> dict[str, str]:  # fmt: skip
    """Have the jobs done and keep each result at once; return what broke, by recording."""
    broken: dict[str, str] = {}
    if not jobs:
        return broken
    with cluster(scheduler, workers) as client:
        for count, (i, done) in enumerate(run_tasks(client, examine_recording, jobs), start=1):
            if isinstance(done, str):
                broken[jobs[i]['recording']] = done
            else:
                write_text(_place(out, jobs[i]), json.dumps(done, indent=1) + '\n')
            progress(0.95 * count / len(jobs))
    return broken


def _place(out: Path, job: Mapping[str, Any]) -> Path:
    """Return the file of the result of one recording."""
    name = job['recording']
    mark = hashlib.sha256(name.encode()).hexdigest()[:8]
    return out / RESULTS / f'{Path(name).stem[:80]}-{mark}.json'


def _is_finished(out: Path, job: Mapping[str, Any]) -> bool:
    """Return whether the result of this recording, robot, version and options is there."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(_place(out, job).read_text(encoding='utf-8'))
        return kept['fingerprint'] == job['fingerprint']
    return False


def _result(
    out: Path, job: Mapping[str, Any], row: TableRow, broken: Mapping[str, str]
) -> dict[str, Any]:
    """Return the result of one recording with its row of the table."""
    name = job['recording']
    if name in broken:
        kept = {'recording': name, 'robot': Path(job['robot']).stem, 'covariates': {},
                'tasks': {t: {'failure': broken[name]} for t in job['arguments']}}  # fmt: skip
    else:
        kept = json.loads(_place(out, job).read_text(encoding='utf-8'))
    if row.time_s is not None:
        kept['start_ns'] = round(row.time_s * 1e9)
    if row.robot:
        kept['robot'] = row.robot
    kept['session'] = row.session or None
    kept['covariates'] = {**kept['covariates'], **row.covariates}
    return kept


def write_campaign(
    out: Path, results: Sequence[Mapping[str, Any]], remarks: Sequence[str]
) -> dict[str, Any]:
    """Write the tables of a campaign; return its summary."""
    rows = result_rows(results)
    write_bytes(out / 'results.parquet', parquet_bytes(rows, COLUMNS))
    write_bytes(out / 'runs.parquet', parquet_bytes(run_rows(results), RUN_COLUMNS))
    failures = [{k: row[k] for k in ('recording', 'task', 'failure')}
                for row in rows if row['kind'] == 'failure']  # fmt: skip
    verdicts: dict[str, int] = {}
    for row in rows:
        if row['kind'] == 'verdict':
            verdicts[row['verdict']] = verdicts.get(row['verdict'], 0) + 1
    trends = find_trends(results)
    content = {
        'schema': _SCHEMA, 'recordings': len(results), 'verdicts': verdicts,
        'failures': failures, 'remarks': list(remarks), 'rows': len(rows),
        'false_alarms': FALSE_ALARMS, 'trends': [trend.content() for trend in trends],
    }  # fmt: skip
    write_text(out / 'campaign.json', json.dumps(content, indent=1, allow_nan=False) + '\n')
    write_text(out / 'report.html', render_campaign(content, results, rows, trends))
    return content


def _print_summary(content: Mapping[str, Any], out: Path) -> None:
    said = ', '.join(f'{n} {verdict}' for verdict, n in sorted(content['verdicts'].items()))
    failed = {f['recording'] for f in content['failures']}
    print(strong(f'{content["recordings"]} recordings: {said or "no verdict"}; '
                 f'{len(failed)} failed'))  # fmt: skip
    for sentence in trend_sentences(content['trends']):
        print(f'  trend     {sentence}')
    for f in content['failures']:
        print(warned(f'  failed    {f["recording"]}, {f["task"]}: {f["failure"]}'))
    for remark in content['remarks']:
        print(warned(f'  remark    {remark}'))
    print(f'table: {out / "results.parquet"}')
    print(f'report: {out / "report.html"}')
    print(next_lines(after_campaign(out)))
