"""Write docs/settings.md from the descriptions in the code: `python docs/generate_settings.py`."""

from __future__ import annotations

import inspect
import math
from pathlib import Path

from sgp_ros.engine.config import describe_settings
from sgp_ros.gp.kernels import KERNELS
from sgp_ros.robots.registry import load_robot
from sgp_ros.ros.settings import FIRST, node_settings

TARGET = Path(__file__).parent / 'settings.md'
HEAD = """# Settings

This page lists all settings, with defaults and ranges. It is generated from the code by
`python docs/generate_settings.py`. Each setting is a ROS parameter of `sgp_node` and a key of the
files in `config/`, which the commands read, too. A read-only setting can only be set at the start. Any
other takes effect before the next sample. If one setting of a request is invalid, the whole request is
refused and changes nothing.

The hyper-parameters shown are those of the default kernel. If `model.kernel` selects another kernel
(see below), its hyper-parameters replace them.

| setting | default | range | unit | what it does |
|---|---|---|---|---|
"""
NODE_HEAD = """
## Settings of the node only

These settings concern the source of the robot, recording, saving and the rates of publication. Commands
ignore them.

| setting | default | range | unit | what it does |
|---|---|---|---|---|
"""
KERNEL_HEAD = """
## Kernels

These are the choices of `model.kernel`. To add one, write one class (`sgp_ros/gp/kernel.py` shows an
example of ten lines) and add it to `KERNELS`. It can then be chosen, learnt, saved and restored.

| kernel | what it is | hyper-parameters of a joint |
|---|---|---|
"""


def _range(setting):
    if setting.choices:
        return ', '.join(setting.choices)
    if math.isfinite(setting.low) or math.isfinite(setting.high):
        return f'{setting.low:g} to {setting.high:g}'
    return ''


def _line(setting, name):
    default = setting.default
    shown = list(default) if isinstance(default, tuple) else default
    note = ' (read-only)' if setting.read_only else ''
    text = setting.description + note
    return f'| `{name}` | `{shown}` | {_range(setting)} | {setting.unit} | {text} |'


def text():
    """Return the page."""
    lines = []
    for setting in describe_settings(load_robot('linear_axis')):
        name = setting.name.replace('hyper.axis.', 'hyper.<joint>.')
        unit = setting.unit.replace('(N)^2', 'target squared')
        lines.append(_line(setting, name).replace(setting.unit or '\0', unit or '\0'))
    node = [_line(setting, setting.name) for setting in (*FIRST, *node_settings())]
    kernels = [
        f'| `{name}` | {_summary(kernel)} | {", ".join(f"`{p.name}`" for p in kernel.parameters)} |'
        for name, kernel in KERNELS.items()
    ]
    parts = ((HEAD, lines), (NODE_HEAD, node), (KERNEL_HEAD, kernels))
    return ''.join(head + '\n'.join(rows) + '\n' for head, rows in parts)


def _summary(kernel):
    return (inspect.getdoc(kernel) or '').splitlines()[0]


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
