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
LIVE = {
    f'/left/sgp_node/{name}': 'JointState'
    for name in ('residual', 'band/lower', 'band/upper', 'predicted_joint_states')
} | {
    '/left/sgp_node/alarm': 'Bool', '/left/sgp_node/diagnosis_status': 'DiagnosticArray',
    '/diagnostics': 'DiagnosticArray',
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
    write_live_layouts(folder, '/left/sgp_node', JOINTS)
    return folder, {'finding': topics, 'live': LIVE}


@pytest.mark.parametrize('kind', ['finding', 'live'])
def test_curves_of_plotjuggler_are_joints_of_topics_that_exist(layouts, kind):
    folder, topics = layouts
    root = ET.parse(folder / f'plotjuggler_{kind}.xml').getroot()
    assert [tab.get('tab_name') for tab in root.iter('Tab')] == list(JOINTS)
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert len(curves) >= 6
    for curve in curves:
        topic, joint, field = curve.rsplit('/', 2)
        assert topics[kind][topic] == 'JointState'
        assert joint in JOINTS
        assert field in {'position', 'velocity', 'effort'}


@pytest.mark.parametrize('kind', ['finding', 'live'])
def test_panels_of_foxglove_read_topics_that_exist_and_all_are_placed(layouts, kind):
    folder, topics = layouts
    content = json.loads((folder / f'foxglove_{kind}.json').read_text())
    panels, text = content['configById'], json.dumps(content['layout'])
    tabs = panels['Tab!joints']['tabs']
    assert [tab['title'] for tab in tabs] == list(JOINTS)
    placed = text + json.dumps(tabs)
    assert all(f'"{name}"' in placed for name in panels)
    named = re.findall(r'"(?:value|path|topicPath|topicToRender)": "(/[\w/]+)', json.dumps(panels))
    assert len(named) > 6
    assert set(named) <= set(topics[kind])
