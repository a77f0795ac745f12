"""Layouts that open on our topics: PlotJuggler (XML), Lichtblick and Foxglove (JSON).

PlotJuggler reads joint states by the names of the joints. Lichtblick and Foxglove, its sibling, go
by index, which is the robot's order on every topic of ours.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from sgp_ros.report.files import write_text

_COLOURS = ('#1f77b4', '#d62728', '#2ca02c', '#9467bd')
Curves = Sequence[tuple[str, str]]
"""Topic and field of a JointState."""
Plots = Mapping[str, Curves]
"""Title to curves; each is drawn for every joint."""

FINDING: Plots = {
    'residuals of the models': (
        ('/finding/residual/nominal', 'effort'), ('/finding/residual/final', 'effort'),
        ('/finding/band/lower', 'effort'), ('/finding/band/upper', 'effort'),
    ),
    'motion': (('/joint_states', 'position'), ('/joint_states', 'velocity')),
}  # fmt: skip


def live_plots(node: str) -> Plots:
    """Return the plots of a running node, from its full name."""
    node = '/' + node.strip('/')
    return {
        'effort and its 95 % band': (
            (f'{node}/predicted_joint_states', 'effort'),
            (f'{node}/band/lower', 'effort'), (f'{node}/band/upper', 'effort'),
        ),
        'residual': ((f'{node}/residual', 'effort'),),
    }  # fmt: skip


def write_finding_layouts(out: Path, joints: Sequence[str]) -> None:
    """Write the layouts for `finding.mcap` into a folder."""
    panels = {
        '3D!robot': {
            'cameraState': {'distance': 3, 'phi': 60, 'thetaOffset': 45, 'perspective': True},
            'followMode': 'follow-none', 'topics': {'/finding/markers': {'visible': True}},
        },
        'RosOut!events': {'searchTerms': [], 'minLogLevel': 1, 'topicToRender': '/finding/events'},
        'RawMessages!verdict': {'topicPath': '/finding/verdict.data'},
    }  # fmt: skip
    _write(out, 'finding', FINDING, joints, panels)


def write_live_layouts(out: Path, node: str, joints: Sequence[str]) -> None:
    """Write the layouts for a running node into a folder."""
    name = '/' + node.strip('/')
    rules = [
        {'operator': '=', 'rawValue': 'true', 'color': '#d62728', 'label': 'ALARM'},
        {'operator': '=', 'rawValue': 'false', 'color': '#2ca02c', 'label': 'calm'},
    ]
    panels = {
        'Indicator!alarm': {
            'path': f'{name}/alarm.data', 'style': 'background', 'rules': rules,
            'fallbackColor': '#a0a0a0', 'fallbackLabel': 'no status',
        },
        'DiagnosticSummary!all': {
            'minLevel': 0, 'pinnedIds': [], 'hardwareIdFilter': '', 'sortByLevel': True,
            'topicToRender': '/diagnostics',
        },
        'RawMessages!diagnosis': {'topicPath': f'{name}/diagnosis_status'},
    }  # fmt: skip
    _write(out, 'live', live_plots(node), joints, panels)


def _write(
    out: Path, name: str, plots: Plots, joints: Sequence[str], panels: dict[str, Any]
) -> None:
    write_text(out / f'plotjuggler_{name}.xml', plotjuggler(plots, joints))
    content = json.dumps(foxglove(plots, joints, panels), indent=1) + '\n'
    write_text(out / f'foxglove_{name}.json', content)


def plotjuggler(plots: Plots, joints: Iterable[str]) -> str:
    """Return a layout with a tab for each joint and its plots one above the other."""
    root = ET.Element('root')
    tabs = ET.SubElement(root, 'tabbed_widget', {'name': 'Main Window', 'parent': 'main_window'})
    for joint in joints:
        tab = ET.SubElement(tabs, 'Tab', containers='1', tab_name=joint)
        sizes = ';'.join([f'{1.0 / len(plots):.3f}'] * len(plots))
        box = ET.SubElement(ET.SubElement(tab, 'Container'), 'DockSplitter', orientation='-')
        box.attrib |= {'sizes': sizes, 'count': str(len(plots))}
        for title, curves in plots.items():
            area = ET.SubElement(box, 'DockArea', name=title)
            plot = ET.SubElement(area, 'plot', mode='TimeSeries', style='Lines')
            plot.attrib |= {'flip_x': 'false', 'flip_y': 'false'}
            for (topic, field), colour in zip(curves, _COLOURS, strict=False):
                ET.SubElement(plot, 'curve', name=f'{topic}/{joint}/{field}', color=colour)
    ET.SubElement(tabs, 'currentTabIndex', index='0')
    ET.SubElement(root, 'use_relative_time_offset', enabled='1')
    ET.indent(root, ' ')
    return ET.tostring(root, 'unicode', xml_declaration=True) + '\n'


def foxglove(plots: Plots, joints: Sequence[str], panels: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layout with the plots of all joints in tabs, and further panels beside them."""
    tabs, content = [], dict(panels)
    for j, joint in enumerate(joints):
        names = []
        for number, (title, curves) in enumerate(plots.items()):
            names.append(f'Plot!{j}_{number}')
            paths = [
                {'value': f'{topic}.{field}[{j}]', 'label': f'{topic} {field}', 'enabled': True,
                 'timestampMethod': 'headerStamp'}
                for topic, field in curves
            ]  # fmt: skip
            content[names[-1]] = {'title': f'{joint}: {title}', 'paths': paths, 'isSynced': True,
                                  'showLegend': True, 'xAxisVal': 'timestamp'}  # fmt: skip
        tabs.append({'title': joint, 'layout': _stack(names)})
    content['Tab!joints'] = {'activeTabIdx': 0, 'tabs': tabs}
    return {
        'configById': content,
        'globalVariables': {},
        'userNodes': {},
        'playbackConfig': {'speed': 1},
        'layout': {'direction': 'row', 'splitPercentage': 60, 'first': 'Tab!joints',
                   'second': _stack(list(panels))},
    }  # fmt: skip


def _stack(names: Sequence[str]) -> Any:
    """Return panels one above the other."""
    first, *rest = names
    if not rest:
        return first
    share = round(100.0 / len(names), 1)
    return {'direction': 'column', 'splitPercentage': share, 'first': first,
            'second': _stack(rest)}  # fmt: skip
