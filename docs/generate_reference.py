"""Write docs/reference from the code: `python docs/generate_reference.py`."""

from __future__ import annotations

import argparse
import ast
import inspect
import json
import textwrap
from pathlib import Path

from sgp_ros.apps import api
from sgp_ros.apps.arguments import COMMANDS
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.robots import lumped, urdf_robot
from sgp_ros.robots.registry import _KEYS, _URDF_KEYS

ROOT = Path(__file__).parents[1]
FOLDER = Path(__file__).parent / 'reference'
NOTE = 'Generated from the code by `python docs/generate_reference.py`.'

TOPICS = {
    '~/prediction': 'mean of accelerations and efforts, made before the measurement',
    '~/prediction_variance': 'variance of the prediction, calibrated by earlier errors',
    '~/prediction_raw_variance': 'variance of the prediction before calibration',
    '~/predicted_joint_states': 'predicted effort by joint name, to plot together with the measured one',
    '~/residual': 'measured minus predicted effort',
    '~/measured_effort': 'commanded or measured effort, filtered like the prediction, in the joint order of the robot',
    '~/band/lower': 'lower end of the 95 % interval of the effort',
    '~/band/upper': 'upper end of this interval',
    '~/parameters': 'value, standard deviation and unit of every parameter',
    '~/parameter_values': 'only the values, to plot',
    '~/monitor': 'distance of the robot from the learned model',
    '~/alarm': 'true while that distance is above its threshold',
    '~/diagnosis': 'the last verdict, as the content of diagnosis.json',
    '~/diagnosis_status': 'progress of a running diagnosis',
    '/diagnostics': 'rate, refused samples by reason, timing, quality of the fit, findings',
}
SERVICES = {
    'refit': 'fit the hyper-parameters to the buffer now',
    'reset': 'discard what was learned, keep the settings',
    'save': 'write the model to `save.path`',
    'diagnose': 'look for missing physics in the last `diagnosis.window` seconds, in another process',
    'cancel_diagnosis': 'cancel a running diagnosis',
    'learn': 'switch between learning (true) and only predicting (false)',
}


def commands():
    """Return the page of the commands."""
    parsers = {}

    def add(name, _function, summary, example):
        parser = argparse.ArgumentParser(prog=f'sgp {name}', add_help=False)
        parsers[name] = parser, summary, example
        return parser

    for add_one in COMMANDS.values():
        add_one(add)
    lines = [
        '# Commands',
        '',
        'This page lists the commands of `sgp` with their arguments. ' + NOTE,
        '',
        'Each command also takes `--out DIR` (folder of the results), `--json` (only the result on stdout, as JSON), `--quiet`,',
        '`--force` (write even if the folder contains other files) and `--help`. The exit status is 0 on success, 2 for an error',
        'that the user can fix (with one line on stderr), and 130 if interrupted. For completion with the Tab key, run',
        '`pip install argcomplete` and `eval "$(register-python-argcomplete sgp)"`.',
        '',
    ]
    for name, (parser, summary, example) in parsers.items():
        lines += [f'## sgp {name}', '', summary, '', '```text', example, '```', '']
        rows = [_argument(action) for action in parser._actions]
        if rows:
            lines += ['| argument | meaning |', '|---|---|', *rows, '']
    return '\n'.join(lines)


def _argument(action):
    name = ', '.join(action.option_strings) or action.metavar or action.dest
    if action.option_strings and action.nargs != 0:
        name += f' {action.metavar or "{" + ",".join(map(str, action.choices or ())) + "}"}'
    said = (action.help or '').replace('%(default)s', str(action.default)).replace('|', '\\|')
    return f'| `{name}` | {said} |'


def topics():
    """Return the page of topics and services of the node."""
    published = _literals('publishers.py', 'publisher')
    lines = [
        '# Topics and services',
        '',
        'This page lists what the node subscribes to, publishes and offers. ' + NOTE,
        '',
        '## Subscribed',
        '',
        '| topic | type | content |',
        '|---|---|---|',
        '| `joint_states` | sensor_msgs/JointState | any order of joints; velocity and effort optional |',
        '| `command` | as `command.type` | the commands, if efforts are not measured |',
        '| `robot_description` | std_msgs/String | the URDF, if `robot` names no robot |',
        '',
        '## Published',
        '',
        '| topic | content |',
        '|---|---|',
    ]
    lines += [f'| `{name}` | {TOPICS[name]} |' for name in published]
    offered = _offered()
    lines += ['', '## Services', '', '| service | type | effect |', '|---|---|---|']
    lines += [f'| `~/{name}` | std_srvs/{kind} | {SERVICES[name]} |' for name, kind in offered]
    return '\n'.join(
        [*lines, '', 'Settings are ROS parameters, see [settings](../settings.md).', '']
    )


def _tree(name):
    return ast.parse((ROOT / 'sgp_ros' / 'ros' / name).read_text(encoding='utf-8'))


def _literals(file, function):
    """Return the topics that a function is called with, bands with both of their ends."""
    found = []
    for node in ast.walk(_tree(file)):
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == function:
            topic = node.args[1]
            if isinstance(topic, ast.Constant):
                found.append(topic.value)
            else:
                found += ['~/band/lower', '~/band/upper']
    return found


def _offered():
    for node in ast.walk(_tree('services.py')):
        if isinstance(node, ast.FunctionDef) and node.name == '_all':
            entries = node.body[-1].value.elts
            return [(entry.elts[0].value, entry.elts[1].id) for entry in entries]
    raise LookupError('services')


def robot_files():
    """Return the page of robot files."""
    return '\n'.join([
        '# Robot files', '', NOTE, '',
        'A robot is given by a name (`sgp robots`), a model file ([URDF, MJCF, SDF](../model_files.md)) or a robot YAML. This page',
        'describes the three kinds of robot YAML. Editors complete and check all of them with [robot.schema.json](robot.schema.json)',
        'if the first line is `# yaml-language-server: $schema=robot.schema.json`.', '',
        '## A URDF with additional statements', '', _code(urdf_robot), '',
        '## Lumped coefficients as formulas', '', _code(lumped), '',
        '## A known robot with changes', '',
        '```yaml', 'schema: 1', 'robot: linear_axis', 'joints: [slide]', 'parameters:',
        '  M: {value: 95.1, std: 0.2, unit: kg}', '```', '',
        'For effects and their parameters, see [effects](../effects.md).', '',
    ])  # fmt: skip


def _code(module):
    text = inspect.getdoc(module) or ''
    blocks = text.split('\n    ', 1)
    head, rest = blocks[0], '    ' + blocks[1]
    body, after = [], []
    for line in rest.splitlines():
        (after if after or (line and not line.startswith('    ')) else body).append(line)
    yaml = textwrap.dedent('\n'.join(body)).strip('\n')
    return f'{head.strip()}\n\n```yaml\n{yaml}\n```\n\n' + '\n'.join(after)


def schema():
    """Return the JSON schema of robot files, for editors."""
    number = {'type': ['number', 'string'], 'description': 'a number or a formula'}
    joints = {'type': 'array', 'items': {'type': ['string', 'object']}}
    quantity = {
        'type': 'object', 'additionalProperties': False,
        'properties': {'value': {'type': ['number', 'string']}, 'std': {'type': ['number', 'null']},
                       'unit': {'type': 'string'}},
    }  # fmt: skip
    effect = {
        'type': 'object',
        'properties': {
            'effect': {'enum': sorted(EFFECTS)}, 'joint': {'type': 'string'},
            'parameters': {'type': 'object', 'additionalProperties': quantity},
            'law': {'type': 'object'},
        },
    }  # fmt: skip
    known = {
        'schema': {'const': 1}, 'joints': joints,
        'effects': {'type': 'array', 'items': effect},
        'parameters': {'type': 'object', 'additionalProperties': quantity},
        'coefficients': {'type': 'object', 'additionalProperties': {
            'type': 'object', 'required': ['columns'], 'additionalProperties': False,
            'properties': {'unit': {'type': 'string'}, 'columns': {'type': 'object'},
                           'value': number, 'source': {'type': 'string'},
                           'meaning': {'type': 'string'}},
        }},
        'target': {'enum': ['acceleration', 'effort']},
    }  # fmt: skip
    kinds = [
        ('of a URDF', _URDF_KEYS, ['urdf']), ('of coefficients', lumped.LUMPED_KEYS, ['coefficients']),
        ('a known one, changed', _KEYS, ['robot']),
    ]  # fmt: skip
    content = {
        '$schema': 'https://json-schema.org/draft/2020-12/schema', 'title': 'robot of sgp_ros',
        'anyOf': [
            {'title': title, 'type': 'object', 'required': ['schema', *required],
             'additionalProperties': False,
             'properties': {key: known.get(key, {}) for key in sorted(keys)}}
            for title, keys, required in kinds
        ],
    }  # fmt: skip
    return json.dumps(content, indent=1) + '\n'


def python():
    """Return the page of the Python API."""
    lines = ['# Python', '', NOTE, '', inspect.getdoc(api).split('\n\n')[0], '']
    lines += [
        '```python',
        'import sgp_ros as sgp',
        '',
        "d = sgp.diagnose('real.mcap', robot='arm.urdf', tests=['other.mcap'])",
        'print(d)',
        '```',
        '',
        'These functions print nothing. An error that a user can cause raises an `SgpError` with a message of one line. A',
        '[notebook](../notebook.ipynb) shows how to use them.',
        '',
    ]
    for name in ('diagnose', 'identify', 'simulate'):
        lines += _member(name, getattr(api, name))
    for kind in (api.Diagnosed, api.Identified):
        lines += [
            f'## {kind.__name__}',
            '',
            inspect.getdoc(kind).split('\n\n')[0],
            '',
            '| member | meaning |',
            '|---|---|',
        ]
        for name, member in vars(kind).items():
            if name.startswith('_') or not (
                isinstance(member, property) or inspect.isfunction(member)
            ):
                continue
            call = '' if isinstance(member, property) else _signature(member)
            said = inspect.getdoc(member).split('\n\n')[0].replace('\n', ' ')
            lines.append(f'| `{name}{call}` | {said} |')
        lines.append('')
    return '\n'.join(lines)


def _member(name, function):
    text = inspect.getdoc(function).replace('Args:', 'Arguments:')
    return [f'## sgp_ros.{name}{_signature(function)}', '', '```text', text, '```', '']


def _signature(function):
    found = inspect.signature(function)
    parameters = [
        p.replace(annotation=p.empty) for p in found.parameters.values() if p.name != 'self'
    ]
    return str(found.replace(parameters=parameters, return_annotation=found.empty))


def pages():
    """Return the text of each page by its path."""
    return {
        FOLDER / 'commands.md': commands(), FOLDER / 'topics.md': topics(),
        FOLDER / 'robot_files.md': robot_files(), FOLDER / 'robot.schema.json': schema(),
        FOLDER / 'python.md': python(),
    }  # fmt: skip


if __name__ == '__main__':
    for path, text in pages().items():
        path.write_text(text, encoding='utf-8')
