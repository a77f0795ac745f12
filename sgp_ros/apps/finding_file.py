"""`finding.mcap`: a diagnosis as a recording, to be looked at beside the one it was made of.

| topic | type | content |
|---|---|---|
| `/joint_states` | JointState | filtered motion and effort |
| `/finding/residual/nominal`, `/finding/residual/final` | JointState | what the models leave |
| `/finding/band/lower`, `/finding/band/upper` | JointState | 95 % of what the final model leaves |
| `/finding/markers` | MarkerArray | links, coloured by their joint's share of the mismatch |
| `/finding/events` | Log | where and when the motion enters a region that was found |
| `/finding/verdict` | String | the verdict in one sentence |

Stamps are those of the recording. Markers lie in the frame of the robot's root, so that they need
no transform.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sgp_ros.diagnosis.result import Diagnosis, Finding
from sgp_ros.engine.samples import JointSample
from sgp_ros.gp.scores import INTERVAL_95
from sgp_ros.recordings.messages import header
from sgp_ros.recordings.typestore import new_message
from sgp_ros.recordings.writer import RecordingWriter
from sgp_ros.report.diagnosis_cards import joint_shares
from sgp_ros.report.diagnosis_text import phrase
from sgp_ros.report.layouts import write_finding_layouts
from sgp_ros.report.robot_picture import link_places, link_segments
from sgp_ros.report.verdict import verdict_sentence
from sgp_ros.rigid.tree import Tree

NAME = 'finding.mcap'
_MARKERS_HZ, _MOST_MARKERS, _MOST_ROWS, _MOST_ENTRIES = 20.0, 4000, 50_000, 1000
_LINE_LIST, _INFO, WARN = 5, 20, 30
_WIDTH_SHARE = 0.03
"""Width of a link in the picture, relative to the robot's extent."""


def write_viewed(out: Path, found: Diagnosis, tree: Tree, start_ns: int) -> None:
    """Write `finding.mcap` and the layouts that open on it, arguments as of `write_finding`."""
    write_finding(out / NAME, found, tree, start_ns)
    write_finding_layouts(out, found.joints)


def write_finding(path: Path, found: Diagnosis, tree: Tree, start_ns: int) -> None:
    """Write a diagnosis as an MCAP file.

    Args:
        path: of the file.
        found: the diagnosis.
        tree: of the robot.
        start_ns: stamp of the first state of the recording [ns].
    """
    traces = found.traces
    every = max(1, -(-len(traces.time) // _MOST_ROWS))
    stamps = (start_ns + np.round(1e9 * traces.time).astype(np.int64)).tolist()
    half = half_band(found)
    with RecordingWriter(path) as writer:
        text = new_message('std_msgs/String', data=verdict_sentence(found))
        writer.write('/finding/verdict', 'std_msgs/String', start_ns, text)
        for i in range(0, len(stamps), every):
            for topic, effort in (
                ('/finding/residual/nominal', traces.before[i]),
                ('/finding/residual/final', traces.after[i]),
                ('/finding/band/lower', -half),
                ('/finding/band/upper', half),
            ):
                empty = np.zeros(0)
                sample = JointSample(stamps[i], found.joints, empty, effort=effort)
                writer.write_joint_state(topic, sample)
            state = (traces.position[i], traces.velocity[i], traces.effort[i])
            writer.write_joint_state('/joint_states', JointSample(stamps[i], found.joints, *state))
        for i in marked_rows(traces.time):
            message = _markers(found, tree, traces.position[i], stamps[i])
            writer.write('/finding/markers', 'visualization_msgs/MarkerArray', stamps[i], message)
        for i, level, name, text in entries(found):
            log = _log(stamps[i], level, name, text)
            writer.write('/finding/events', 'rcl_interfaces/Log', stamps[i], log)


def marked_rows(time: np.ndarray) -> list[int]:
    """Return the rows at which the robot is drawn: 20 a second, fewer of a long recording."""
    rate_hz = min(_MARKERS_HZ, _MOST_MARKERS / max(float(np.ptp(time)), 1e-9))
    return np.unique(np.floor(time * rate_hz), return_index=True)[1].tolist()


def entries(found: Diagnosis) -> Iterator[tuple[int, int, str, str]]:
    """Yield row, level, joint and text of what begins there."""
    for finding in found.findings:
        said = f'{phrase(finding)} of {finding.joint}'
        place = finding.location
        regions = list(_regions(found, finding))
        if not regions:
            yield 0, WARN, finding.joint, f'{said}: everywhere'
        for inside, where in regions:
            begins = np.flatnonzero(inside & ~np.append(False, inside[:-1]))
            for i in begins[:_MOST_ENTRIES].tolist():
                yield i, WARN, finding.joint, f'{said}: enters {where}'
        for t0, t1 in place.time:
            for t, what in ((t0, 'begins'), (t1, 'ends')):
                i = min(int(np.searchsorted(found.traces.time, t)), len(found.traces.time) - 1)
                yield i, _INFO, finding.joint, f'{said}: {what}'


def _regions(found: Diagnosis, finding: Finding) -> Iterator[tuple[np.ndarray, str]]:
    """Yield which rows lie in each region of a finding, (N,) of bool, and its name."""
    if finding.joint not in found.joints:
        return
    j = found.joints.index(finding.joint)
    for variable, intervals in finding.location.intervals.items():
        signal = getattr(found.traces, variable, None)
        if signal is None or signal.ndim != 2:
            continue
        for low, high in intervals:
            inside = (signal[:, j] >= low) & (signal[:, j] <= high)
            yield inside, f'{variable} {low:.4g} to {high:.4g}'


def _log(stamp_ns: int, level: int, name: str, text: str) -> Any:
    return new_message(
        'rcl_interfaces/Log', stamp=header(new_message, stamp_ns).stamp, level=level, name=name,
        msg=text, file='', function='', line=0,
    )  # fmt: skip


def coloured_links(
    found: Diagnosis, tree: Tree, posture: np.ndarray
) -> Iterator[tuple[str, np.ndarray, float]]:
    """Yield name, ends (2, 3) [m] and share of the mismatch of each link in a posture (k,)."""
    rotations, origins = link_places(tree, posture)
    shares = dict(joint_shares(found))
    body, ends = link_segments(tree, rotations, origins)
    for i, line in zip(body.tolist(), ends, strict=True):
        share = 0.0 if i < 0 else shares.get(tree.joint_names[int(tree.follows[i])], 0.0)
        yield 'ground' if i < 0 else tree.link_names[i], line, share


def colour_of(share: float) -> tuple[float, float, float]:
    """Return red, green and blue of a share, from grey to red."""
    grey = 0.75 * (1.0 - share)
    return 0.75 + 0.25 * share, grey, grey


def half_band(found: Diagnosis) -> np.ndarray:
    """Return half the interval that holds 95 % of the final model's residual, (k,)."""
    return INTERVAL_95 * np.sqrt(np.nanmean(found.traces.after**2, axis=0))


def _markers(found: Diagnosis, tree: Tree, posture: np.ndarray, stamp_ns: int) -> Any:
    links = list(coloured_links(found, tree, posture))
    ends = np.array([line for _, line, _ in links]).reshape(-1, 3)
    width = _WIDTH_SHARE * max(float(np.ptp(ends, axis=0).max()), 1e-3)
    markers = [
        _marker(stamp_ns, number, _root(tree), *link, width) for number, link in enumerate(links)
    ]
    return new_message('visualization_msgs/MarkerArray', markers=markers)


def _root(tree: Tree) -> str:
    return next((frame.name for frame in tree.frames if frame.body < 0), 'base_link')


def _marker(
    stamp_ns: int, number: int, frame: str, name: str, line: np.ndarray, share: float, width: float
) -> Any:
    """Return a line of one link, from grey to red with its share of the mismatch."""
    stamped = header(new_message, stamp_ns)
    stamped.frame_id = frame
    return new_message(
        'visualization_msgs/Marker', header=stamped, ns=name, id=number,
        scale=new_message('geometry_msgs/Vector3', x=width, y=0.0, z=0.0),
        color=_colour(*colour_of(share)), points=[_point(end) for end in line],
        text=f'{name} {100.0 * share:.0f} %', **_in_every_marker(),
    )  # fmt: skip


@cache
def _in_every_marker() -> dict[str, Any]:
    nothing = np.zeros(0, dtype=np.uint8)
    return {
        'type': _LINE_LIST, 'action': 0, 'frame_locked': False, 'colors': [],
        'texture_resource': '', 'uv_coordinates': [], 'mesh_resource': '',
        'mesh_use_embedded_materials': False,
        'pose': new_message(
            'geometry_msgs/Pose', position=_point(np.zeros(3)),
            orientation=new_message('geometry_msgs/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0),
        ),
        'lifetime': new_message('builtin_interfaces/Duration', sec=0, nanosec=0),
        'texture': new_message(
            'sensor_msgs/CompressedImage', header=header(new_message, 0), format='', data=nothing
        ),
        'mesh_file': new_message('visualization_msgs/MeshFile', filename='', data=nothing),
    }  # fmt: skip


def _point(values: Sequence[float] | np.ndarray) -> Any:
    x, y, z = (float(value) for value in values)
    return new_message('geometry_msgs/Point', x=x, y=y, z=z)


def _colour(red: float, green: float, blue: float) -> Any:
    return new_message('std_msgs/ColorRGBA', r=red, g=green, b=blue, a=1.0)
