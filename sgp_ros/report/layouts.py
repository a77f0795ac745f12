"""Layouts that open on our topics: PlotJuggler (XML), Lichtblick and Foxglove (JSON).

PlotJuggler reads joint states by the names of the joints. Lichtblick and Foxglove, its sibling,
filter arrays of structures by name, such as the statuses of parameters, but not the parallel
arrays of a joint state. These go by index there, only on topics of ours, which always hold all
joints in the robot's order.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from sgp_ros.report.files import write_text

_COLOURS = ('#1f77b4', '#d62728', '#2ca02c', '#9467bd')
_MOST_PLOTS = 8
Curves = Sequence[tuple[str, str]]
"""Topic and field of a JointState."""
Plots = Mapping[str, Curves]
"""Title to curves; each is drawn for every joint."""
Tab = tuple[str, Sequence[tuple[str, Sequence[tuple[str, str]]]]]
"""Title, and its plots: title and curves, as PlotJuggler and as Foxglove name them."""

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
        'effort, prediction and its 95 % band': (
            (f'{node}/measured_effort', 'effort'), (f'{node}/predicted_joint_states', 'effort'),
            (f'{node}/band/lower', 'effort'), (f'{node}/band/upper', 'effort'),
        ),
        'residual': ((f'{node}/residual', 'effort'),),
    }  # fmt: skip


def joint_tabs(plots: Plots, joints: Iterable[str]) -> list[Tab]:
    """Return a tab with all plots for each joint, in the order of the robot."""
    return [
        (joint, [
            (title, [(f'{t}/{joint}/{field}', f'{t}.{field}[{j}]') for t, field in curves])
            for title, curves in plots.items()
        ])
        for j, joint in enumerate(joints)
    ]  # fmt: skip


def parameter_tabs(node: str, parameters: Sequence[str]) -> list[Tab]:
    """Return tabs with a plot for each parameter: its value, in PlotJuggler with its interval."""
    node = '/' + node.strip('/')
    tabs: list[Tab] = []
    for start in range(0, len(parameters), _MOST_PLOTS):
        plots = []
        for name in parameters[start : start + _MOST_PLOTS]:
            stem = f'{node}/parameter_values/{name}'
            value = (
                f'{node}/parameters.status[:]{{name=="{name}"}}.values[:]{{key=="value"}}.value'
            )
            interval = [(f'{stem}/{end}', '') for end in ('velocity', 'effort')]
            plots.append((name, [(f'{stem}/position', value), *interval]))
        tabs.append((f'parameters {start // _MOST_PLOTS + 1}', plots))
    return tabs


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
    _write(out, 'finding', joint_tabs(FINDING, joints), panels)


def write_live_layouts(
    out: Path, node: str, joints: Sequence[str], parameters: Sequence[str] = ()
) -> None:
    """Write the layouts for a running node into a folder; parameters have tabs of their own."""
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
    tabs = joint_tabs(live_plots(node), joints) + parameter_tabs(node, parameters)
    _write(out, 'live', tabs, panels)


def _write(out: Path, name: str, tabs: Sequence[Tab], panels: dict[str, Any]) -> None:
    write_text(out / f'plotjuggler_{name}.xml', plotjuggler(tabs))
    content = json.dumps(foxglove(tabs, panels), indent=1) + '\n'
    write_text(out / f'foxglove_{name}.json', content)


def plotjuggler(pages: Iterable[Tab]) -> str:
    """Return a layout with the plots of each tab one above the other."""
    root = ET.Element('root')
    tabs = ET.SubElement(root, 'tabbed_widget', {'name': 'Main Window', 'parent': 'main_window'})
    for heading, plots in pages:
        tab = ET.SubElement(tabs, 'Tab', containers='1', tab_name=heading)
        sizes = ';'.join([f'{1.0 / len(plots):.3f}'] * len(plots))
        box = ET.SubElement(ET.SubElement(tab, 'Container'), 'DockSplitter', orientation='-')
        box.attrib |= {'sizes': sizes, 'count': str(len(plots))}
        for title, curves in plots:
            area = ET.SubElement(box, 'DockArea', name=title)
            plot = ET.SubElement(area, 'plot', mode='TimeSeries', style='Lines')
            plot.attrib |= {'flip_x': 'false', 'flip_y': 'false'}
            for (curve, _), colour in zip(curves, _COLOURS, strict=False):
                ET.SubElement(plot, 'curve', name=curve, color=colour)
    ET.SubElement(tabs, 'currentTabIndex', index='0')
    ET.SubElement(root, 'use_relative_time_offset', enabled='1')
    ET.indent(root, ' ')
    return ET.tostring(root, 'unicode', xml_declaration=True) + '\n'


def foxglove(pages: Iterable[Tab], panels: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layout with the plots in tabs, and further panels beside them."""
    tabs, content = [], dict(panels)
    for j, (heading, plots) in enumerate(pages):
        names = []
        for number, (title, curves) in enumerate(plots):
            names.append(f'Plot!{j}_{number}')
            paths = [
                {'value': path, 'label': curve, 'enabled': True, 'timestampMethod': 'headerStamp'}
                for curve, path in curves
                if path
            ]
            content[names[-1]] = {'title': f'{heading}: {title}', 'paths': paths, 'isSynced': True,
                                  'showLegend': True, 'xAxisVal': 'timestamp'}  # fmt: skip
        tabs.append({'title': heading, 'layout': _stack(names)})
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
