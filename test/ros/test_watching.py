"""The dashboard of a running node."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from sgp_ros.recordings.messages import Status, diagnostics_message
from sgp_ros.ros.messages import new_message
from sgp_ros.ros.watching import Picture, dashboard
from test.ros.graph import DEADLINE_S, Graph
from test.ros.test_node import QUICK

ROOT = Path(__file__).parents[2]


def _shown(picture: Picture) -> str:
    text = io.StringIO()
    Console(file=text, width=110).print(dashboard(picture))
    return text.getvalue()


def _message(*statuses: Status) -> Any:
    return diagnostics_message(new_message, 0, statuses)


def test_joints_parameters_and_warnings_are_shown() -> None:
    """Of the node asked for alone; what is not determined is said so."""
    picture = Picture('/left/sgp_node')
    fit = {'effort.nmse': '0.0123', 'effort.coverage95': '0.951', 'drift': '0.2'}
    picture.hear(
        _message(
            Status('left/sgp_node: samples', 0, 'fine', 'arm', {'rate_hz': '499', 'lost': '3'}),
            Status('left/sgp_node: fit elbow', 1, 'elbow: errors have grown', 'arm', fit),
            Status('left/sgp_node: monitor elbow', 1, 'outside', 'arm', {'alarm': '1'}),
            Status('right/sgp_node: fit wrist', 2, 'not ours', 'arm', {}),
            Status('right/sgp_node: samples', 0, 'not ours', 'arm', {}),
        )
    )
    picture.hear_parameters(
        _message(
            Status('mass', 0, '', 'arm', {'value': '1.25', 'std': '0.01', 'unit': 'kg'}),
            Status('ixx', 0, '', 'arm', {'value': '0.0', 'unit': 'kg m^2'}),
        )
    )
    text = _shown(picture)
    for words in ('elbow', '0.0123', '0.951', 'ALARM', 'errors have grown', '499', '3 lost'):
        assert words in text
    for words in ('mass', '1.25', '0.02', 'kg', 'undetermined'):
        assert words in text
    assert 'wrist' not in text
    assert picture.others == {'/right/sgp_node'}


def test_what_a_report_leaves_out_is_shown_no_more() -> None:
    """Such as the findings of an earlier diagnosis."""
    picture = Picture('/sgp_node')
    samples = Status('sgp_node: samples', 0, 'fine', 'arm', {})
    finding = Status('sgp_node: diagnosis spring elbow', 1, 'on elbow: spring', 'arm', {})
    picture.hear(_message(samples, finding))
    assert 'on elbow: spring' in _shown(picture)
    picture.hear(_message(Status('left/sgp_node: samples', 0, 'not ours', 'arm', {})))
    assert 'on elbow: spring' in _shown(picture)
    picture.hear(_message(samples))
    assert 'on elbow: spring' not in _shown(picture)


@pytest.mark.ros
def test_a_running_node_is_shown(graph: Graph) -> None:
    """The command ends after one picture, with status 0."""
    graph.start('sgp_node', **QUICK)
    graph.wait_until(lambda: graph.status('model'), 'the node')
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', 'watch', '--once', '--wait', '30',
         '--layouts', str(graph.folder / 'l')],
        capture_output=True, text=True, check=False, timeout=DEADLINE_S, env=os.environ, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert 'reaction_wheel' in done.stdout
    assert 'wheel' in done.stdout
    assert len(list((graph.folder / 'l').iterdir())) == 2


@pytest.mark.ros
@pytest.mark.usefixtures('context')
def test_a_node_that_is_not_there_is_one_line() -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'sgp_ros.cli', 'watch', '--node', '/nobody', '--wait', '0.5'],
        capture_output=True, text=True, check=False, timeout=DEADLINE_S, env=os.environ, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 2
    assert 'nothing from /nobody' in done.stderr
    assert len(done.stderr.splitlines()) == 1
