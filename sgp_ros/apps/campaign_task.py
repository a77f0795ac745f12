"""Task of a worker for one recording of a campaign."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.apps.diagnose import examine
from sgp_ros.apps.identify import identify_recording
from sgp_ros.campaign.table import Row, diagnosis_rows, identification_rows
from sgp_ros.diagnosis.mapping import diagnosis_mapping
from sgp_ros.engine.samples import JointSample
from sgp_ros.errors import RecordingError, SgpError
from sgp_ros.recordings.reader import Recording, open_recording
from sgp_ros.report.metrics import versions

_FIELDS = ('data', 'temperature', 'relative_humidity', 'fluid_pressure', 'voltage')
"""Of messages whose number may be a covariate: std_msgs, and some of sensor_msgs."""


def examine_recording(job: Mapping[str, Any]) -> dict[str, Any]:
    """Return the result of one recording: rows or a failure by task, their cost, remarks.

    It runs in a worker. An error that the recording causes is a result too, in one line.
    """
    tasks: dict[str, Any] = {}
    result = {key: job[key] for key in ('recording', 'fingerprint')}
    result['versions'] = ', '.join(f'{name} {x}' for name, x in versions().items())
    result |= {'robot': Path(job['robot']).stem, 'covariates': {}}
    try:
        recording = open_recording(job['path'])
        result |= _span(recording, next(iter(job['arguments'].values())))
        result['covariates'] = {topic: mean_of_topic(recording, topic)
                                for topic in job['topics']}  # fmt: skip
        result['remarks'] = list(recording.remarks)
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


def _span(recording: Recording, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the first stamp [ns] and the length [s] of a recording."""
    events = recording.events(options['joint_states'], options['command'])
    stamps = [event.stamp_ns for event in events if isinstance(event, JointSample)]
    if not stamps:
        raise RecordingError(f'{recording.path} contains no states', 'joint states')
    return {'start_ns': min(stamps), 'duration_s': 1e-9 * (max(stamps) - min(stamps))}


def mean_of_topic(recording: Recording, topic: str) -> float:
    """Return the mean of the numbers of a topic: `data`, `temperature` or another single field.

    Raises:
        RecordingError: no such topic, or no number in its messages.
    """
    values = []
    for _, message in recording.messages(topic):
        found = [getattr(message, name, None) for name in _FIELDS]
        values += [float(x) for x in found if isinstance(x, Real)][:1]
    if not values or not np.isfinite(values).any():
        raise RecordingError(
            f'{topic} of {recording.path} contains no numbers',
            'messages with data or temperature',
            'give its values with --covariates',
        )  # fmt: skip
    return float(np.nanmean(np.where(np.isfinite(values), values, np.nan)))
