"""The page of a check: what a recording holds, joint by joint, and how the robot is connected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from sgp_ros.batch.recording_check import GAP
from sgp_ros.diagnosis.result import Finding
from sgp_ros.engine.samples import Event, JointSample
from sgp_ros.report.charts import Chart, Series, kept, spoken
from sgp_ros.report.diagnosis_text import phrase, place, plain_name
from sgp_ros.report.metrics import versions
from sgp_ros.report.next_steps import Steps
from sgp_ros.report.page import render_page
from sgp_ros.report.robot_picture import picture_of_robot
from sgp_ros.robots.robot import Robot

_MOST_JOINTS = 12
KINDS = {'unnamed': 'without joint names'}
"""Words for kinds of commands that are not their own."""


def render_check(
    content: Mapping[str, Any],
    events: Sequence[Event],
    robot: Robot,
    setup: Sequence[Finding],
    steps: Steps,
) -> str:
    """Return the page as HTML; every text in it is escaped.

    Args:
        content: of check.json.
        events: of the recording.
        robot: whose joints are looked for.
        setup: errors of the connection.
        steps: what to do next.
    """
    charts = position_charts(events, robot)
    return render_page(
        'check.html', charts, {},
        title=f'Check of {content["recording"]} for {content["robot"]}',
        verdict=check_sentence(content, setup),
        is_fit=content['is_fit'],
        picture=Markup(picture_of_robot(robot, _posture(events), {})),  # noqa: S704 - escaped
        setup=[{'place': place(f), 'text': phrase(f), 'p': f'{f.probability:.2f}'} for f in setup],
        joints=content['joints'].items(),
        units={joint.name: joint.unit('position') for joint in robot.joints},
        has_limits=any(j['range_share'] is not None for j in content['joints'].values()),
        shown=list(charts),
        counts=_counts(content),
        remarks=content['remarks'],
        next_steps=list(steps),
        versions=list(versions().items()),
    )  # fmt: skip


def _posture(events: Sequence[Event]) -> dict[str, float]:
    """Return the median position of each joint that finite states name [rad or m]."""
    found: dict[str, list[float]] = {}
    for event in events:
        if isinstance(event, JointSample) and len(event.position) == len(event.names):
            for name, x in zip(event.names, event.position, strict=True):
                if np.isfinite(x):
                    found.setdefault(name, []).append(float(x))
    return {name: float(np.median(x)) for name, x in found.items()}


def _counts(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    kinds = ', '.join(KINDS.get(kind, kind) for kind in content['command_kinds'])
    jitter = 100.0 * content['jitter'] if content['jitter'] is not None else 0.0
    stamps = ', '.join(f'{content[name]} {name}' for name in ('gaps', 'backward', 'repeated'))
    return [
        ('states', f'{content["states"]} in {content["seconds"]:.4g} s'),
        ('rate', f'{content["rate_hz"]:.4g} Hz, jitter {max(round(jitter, 2), 0.0):g} %'),
        ('commands', f'{content["commands"]}, {kinds}' if kinds else 'none'),
        ('stamps', stamps),
    ]


def check_sentence(content: Mapping[str, Any], setup: Sequence[Finding]) -> str:
    """Say whether a recording is fit for a diagnosis, and what is wrong with it first."""
    name = content['recording']
    if content['missing']:
        return f'{name} cannot be diagnosed: it has no states for {", ".join(content["missing"])}.'
    if not content['is_fit']:
        return f'{name} cannot be diagnosed: {content["remarks"][-1]}'
    still = [joint for joint, j in content['joints'].items() if not j['moves']]
    text = f'{name} can be diagnosed'
    if still:
        text += f', but without {", ".join(still)}: there is no motion above the noise'
    if setup:
        text += f'. First correct the set-up: {place(setup[0])}, {phrase(setup[0])}'
    rivals = [
        f'{plain_name(e)} of {j}' for pairs in content.get('equivalents', ()) for j, e in pairs
    ]
    if rivals:
        text += f'; this motion cannot separate missing physics from {" or ".join(rivals)}'
    return f'{text}.'


def position_charts(events: Sequence[Event], robot: Robot) -> dict[str, Chart]:
    """Return the position of each joint over time, by name; of the first twelve joints."""
    states = [e for e in events if isinstance(e, JointSample)]
    charts = {}
    for joint in robot.joints[:_MOST_JOINTS]:
        own = [
            (s.stamp_ns, s.position[s.names.index(joint.name)])
            for s in states
            if joint.name in s.names and len(s.position) == len(s.names)
        ]
        own = sorted((t, x) for t, x in own if np.isfinite(x))
        if len(own) < 2:
            continue
        stamps, q = (np.array(x) for x in zip(*own, strict=True))
        unit = joint.unit('position')
        said = f'Between {spoken(q.min())} and {spoken(q.max())} {unit}.'
        time, q = _broken((stamps - stamps[0]) * 1e-9, q)
        rows = kept([q])
        charts[f'position {joint.name}'] = Chart(
            f'Position of {joint.name}', said, 'time [s]', f'position [{unit}]', time[rows],
            [Series('measured', q[rows], 'final')], group='check',
        )  # fmt: skip
    return charts


def _broken(time: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve over time [s], both (n,), with a break in each gap, where none is known."""
    step = np.diff(time)
    at = np.flatnonzero(step > GAP * np.median(step[step > 0.0])) + 1
    return np.insert(time, at, 0.5 * (time[at - 1] + time[at])), np.insert(q, at, np.nan)
