"""`sgp campaign`: diagnose and identify each of many recordings, then look at them together."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros import __version__
from sgp_ros.apps.diagnose import examine
from sgp_ros.apps.identify import identify_recording
from sgp_ros.apps.terminal import strong, warned
from sgp_ros.campaign.cluster import cluster, run_tasks
from sgp_ros.campaign.recordings import Told, find_recordings, read_covariates
from sgp_ros.campaign.table import (
    COLUMNS,
    RUN_COLUMNS,
    Row,
    diagnosis_rows,
    identification_rows,
    parquet_bytes,
    require_parquet,
    result_rows,
    run_rows,
)
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import ConfigError, RecordingError, SgpError
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.files import replacing_results, write_bytes, write_text
from sgp_ros.report.metrics import versions
from sgp_ros.robots.models.door import is_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import urdf_text

TASKS = {'both': ('diagnose', 'identify'), 'diagnose': ('diagnose',), 'identify': ('identify',)}
RESULTS = 'recordings'
"""Folder of the finished recordings, one JSON file each."""
_SCHEMA = 1


@dataclass(frozen=True, slots=True)
class CampaignOptions:
    """What is made of each recording, and of all.

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
    told = read_covariates(chosen.covariates, tuple(found), remarks)
    jobs = _jobs(found, robot, chosen)
    with replacing_results(out, 'campaign'):
        (out / RESULTS).mkdir(exist_ok=True)
        open_jobs = [job for job in jobs if not _is_finished(out, job)]
        print(f'{len(jobs)} recordings, {len(jobs) - len(open_jobs)} of them finished before')
        broken = _compute(out, open_jobs, scheduler, workers, progress)
        results = [_result(out, job, told[job['recording']], broken) for job in jobs]
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


def examine_recording(job: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is kept of one recording: rows or a failure by task, and what they cost.

    It runs in a worker. What the recording can cause is a result too, in one line.
    """
    tasks: dict[str, Any] = {}
    result = {key: job[key] for key in ('recording', 'fingerprint')}
    result['versions'] = ', '.join(f'{name} {x}' for name, x in versions().items())
    result |= {'robot': Path(job['robot']).stem, 'covariates': {}}
    try:
        result |= _span(job)
        result['covariates'] = {topic: mean_of_topic(job['path'], topic)
                                for topic in job['topics']}  # fmt: skip
    except (SgpError, OSError) as error:
        failure = {'failure': ' '.join(str(error).split())}
        return result | {'tasks': dict.fromkeys(job['arguments'], failure)}
    for task, options in job['arguments'].items():
        wall, processor = time.perf_counter(), time.process_time()
        try:
            tasks[task] = {'rows': _rows(task, job, options)}
        except (SgpError, OSError) as error:
            tasks[task] = {'failure': ' '.join(str(error).split())}
        tasks[task]['cost'] = {
            'processor_s': time.process_time() - processor,
            'wall_s': time.perf_counter() - wall,
            'worker': f'{os.uname().nodename} {os.getpid()}',
        }
    return result | {'tasks': tasks}


def _rows(task: str, job: Mapping[str, Any], options: Mapping[str, Any]) -> list[Row]:
    if task == 'identify':
        found = identify_recording(job['path'], job['robot'], **options)
        return list(identification_rows(found.findings))
    examined = examine(job['path'], job['robot'], **options)
    return list(diagnosis_rows(diagnosis_mapping(examined.found)))


def _span(job: Mapping[str, Any]) -> dict[str, Any]:
    """Return the first stamp [ns] and the length [s] of a recording."""
    topics = {k: next(iter(job['arguments'].values()))[k] for k in ('joint_states', 'command')}
    events = open_recording(job['path']).events(**topics)
    stamps = [event.stamp_ns for event in events if isinstance(event, JointSample)]
    if not stamps:
        raise RecordingError(f'{job["path"]} holds no state', 'joint states')
    return {'start_ns': min(stamps), 'duration_s': 1e-9 * (max(stamps) - min(stamps))}


def mean_of_topic(path: str, topic: str) -> float:
    """Return the mean of the numbers of a topic: `data`, `temperature` or another single field.

    Raises:
        RecordingError: no such topic, or no number in its messages.
    """
    values = []
    for _, message in open_recording(path).messages(topic):
        for name in ('data', 'temperature', 'relative_humidity', 'fluid_pressure', 'voltage'):
            with suppress(TypeError, ValueError, AttributeError):
                values.append(float(getattr(message, name)))
                break
    if not values or not np.isfinite(values).any():
        raise RecordingError(
            f'{topic} of {path} holds no number', 'messages with data or temperature',
            'give its values with --covariates',
        )  # fmt: skip
    return float(np.nanmean(np.where(np.isfinite(values), values, np.nan)))


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
    out: Path, job: Mapping[str, Any], told: Told, broken: Mapping[str, str]
) -> dict[str, Any]:
    """Return the result of one recording with what a table tells of it."""
    name = job['recording']
    if name in broken:
        kept = {'recording': name, 'robot': Path(job['robot']).stem, 'covariates': {},
                'tasks': {t: {'failure': broken[name]} for t in job['arguments']}}  # fmt: skip
    else:
        kept = json.loads(_place(out, job).read_text(encoding='utf-8'))
    if told.time_s is not None:
        kept['start_ns'] = round(told.time_s * 1e9)
    if told.robot:
        kept['robot'] = told.robot
    kept['session'] = told.session or None
    kept['covariates'] = {**kept['covariates'], **told.covariates}
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
    content = {
        'schema': _SCHEMA, 'recordings': len(results), 'verdicts': verdicts,
        'failures': failures, 'remarks': list(remarks), 'rows': len(rows),
    }  # fmt: skip
    write_text(out / 'campaign.json', json.dumps(content, indent=1, allow_nan=False) + '\n')
    return content


def _print_summary(content: Mapping[str, Any], out: Path) -> None:
    said = ', '.join(f'{n} {verdict}' for verdict, n in sorted(content['verdicts'].items()))
    failed = {f['recording'] for f in content['failures']}
    print(strong(f'{content["recordings"]} recordings: {said or "no verdict"}; '
                 f'{len(failed)} failed'))  # fmt: skip
    for f in content['failures']:
        print(warned(f'  failed    {f["recording"]}, {f["task"]}: {f["failure"]}'))
    for remark in content['remarks']:
        print(warned(f'  remark    {remark}'))
    print(f'results: {out / "results.parquet"}')
