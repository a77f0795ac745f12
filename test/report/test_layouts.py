"""Layouts of PlotJuggler, Lichtblick and Foxglove name topics that exist."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET

import pytest

from sgp_ros.apps.finding_file import write_finding
from sgp_ros.recordings.reader import open_recording
from sgp_ros.report.layouts import write_finding_layouts, write_live_layouts
from sgp_ros.rigid.tree import read_urdf
from test.apps.test_finding_file import ARM
from test.report.diagnoses import COULOMB, diagnosis

JOINTS = ('shoulder', 'elbow')
PARAMETERS = tuple(f'w{i}' for i in range(10))
LIVE = {
    f'/left/sgp_node/{name}': 'JointState'
    for name in (
        'residual', 'band/lower', 'band/upper', 'predicted_joint_states', 'measured_effort',
        'parameter_values',
    )
} | {
    '/left/sgp_node/alarm': 'Bool', '/left/sgp_node/diagnosis_status': 'DiagnosticArray',
    '/diagnostics': 'DiagnosticArray', '/left/sgp_node/parameters': 'DiagnosticArray',
}  # fmt: skip


@pytest.fixture(scope='module')
def layouts(tmp_path_factory):
    """Return the folder of all layouts, and the topics that there are for each kind."""
    folder = tmp_path_factory.mktemp('layouts')
    write_finding(
        folder / 'finding.mcap', diagnosis('missing_physics', [COULOMB]), read_urdf(ARM), 10**18
    )
    topics = {t.name: t.type.split('/')[1] for t in open_recording(folder / 'finding.mcap').topics}
    write_finding_layouts(folder, JOINTS)
    write_live_layouts(folder, '/left/sgp_node', JOINTS, PARAMETERS)
    return folder, {'finding': topics, 'live': LIVE}


def _tabs(kind):
    return [*JOINTS, *(['parameters 1', 'parameters 2'] if kind == 'live' else [])]


def test_the_measured_effort_lies_beside_its_prediction_and_band(layouts):
    """Of the same joint, in one plot of either tool."""
    folder, _ = layouts
    ends = ('measured_effort', 'predicted_joint_states', 'band/lower', 'band/upper')
    root = ET.parse(folder / 'plotjuggler_live.xml').getroot()
    plots = [[c.get('name') for c in plot.iter('curve')] for plot in root.iter('plot')]
    assert [f'/left/sgp_node/{end}/elbow/effort' for end in ends] in plots
    panels = json.loads((folder / 'foxglove_live.json').read_text())['configById'].values()
    paths = [[path['value'] for path in p['paths']] for p in panels if 'paths' in p]
    assert [f'/left/sgp_node/{end}.effort[1]' for end in ends] in paths


def test_every_parameter_is_plotted_by_name(layouts):
    """With its interval in PlotJuggler; Foxglove looks for the name in an array of statuses."""
    folder, _ = layouts
    root = ET.parse(folder / 'plotjuggler_live.xml').getroot()
    curves = {curve.get('name') for curve in root.iter('curve')}
    panels = json.loads((folder / 'foxglove_live.json').read_text())['configById'].values()
    paths = {path['value'] for p in panels for path in p.get('paths', ())}
    for name in PARAMETERS:
        for field in ('position', 'velocity', 'effort'):
            assert f'/left/sgp_node/parameter_values/{name}/{field}' in curves
        filters = f'status[:]{{name=="{name}"}}.values[:]{{key=="value"}}.value'
        assert f'/left/sgp_node/parameters.{filters}' in paths


@pytest.mark.parametrize('kind', ['finding', 'live'])
def test_curves_of_plotjuggler_are_joints_of_topics_that_exist(layouts, kind):
    folder, topics = layouts
    root = ET.parse(folder / f'plotjuggler_{kind}.xml').getroot()
    assert [tab.get('tab_name') for tab in root.iter('Tab')] == _tabs(kind)
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert len(curves) >= 6
    for curve in curves:
        topic, joint, field = curve.rsplit('/', 2)
        assert topics[kind][topic] == 'JointState'
        assert joint in (PARAMETERS if topic.endswith('/parameter_values') else JOINTS)
        assert field in {'position', 'velocity', 'effort'}


@pytest.mark.parametrize('kind', ['finding', 'live'])
def test_panels_of_foxglove_read_topics_that_exist_and_all_are_placed(layouts, kind):
    folder, topics = layouts
    content = json.loads((folder / f'foxglove_{kind}.json').read_text())
    panels, text = content['configById'], json.dumps(content['layout'])
    tabs = panels['Tab!joints']['tabs']
    assert [tab['title'] for tab in tabs] == _tabs(kind)
    placed = text + json.dumps(tabs)
    assert all(f'"{name}"' in placed for name in panels)
    named = re.findall(r'"(?:value|path|topicPath|topicToRender)": "(/[\w/]+)', json.dumps(panels))
    assert len(named) > 6
    assert set(named) <= set(topics[kind])
