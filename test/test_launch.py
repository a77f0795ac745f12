"""The launch files, run with stand-ins that record what they are given.

`launch` is on no registry for pip, so neither it nor a launched process is tested here: only what
the files ask of it.
"""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / 'launch').glob('*.launch.py'))


def _recorded(name):
    def make(*positional, **named):
        return SimpleNamespace(kind=name, positional=positional, **named)

    return make


@pytest.fixture
def launch(monkeypatch):
    """Return what runs a launch file with arguments: its declared arguments and its nodes."""

    def configuration(name):
        return SimpleNamespace(perform=lambda context: context[name])

    names = {
        'launch': {'LaunchDescription': list},
        'launch.actions': {n: _recorded(n) for n in ('DeclareLaunchArgument', 'OpaqueFunction')},
        'launch.substitutions': {'LaunchConfiguration': configuration},
        'launch_ros': {},
        'launch_ros.actions': {'Node': _recorded('Node')},
        'launch_ros.parameter_descriptions': {'ParameterValue': lambda value, value_type: value},
        'ament_index_python': {},
        'ament_index_python.packages': {'get_package_share_directory': lambda _: str(ROOT)},
    }
    for name, content in names.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)

    def run(path, **given):
        entities = runpy.run_path(str(path))['generate_launch_description']()
        *declared, made = entities
        defaults = {argument.positional[0]: argument.default_value for argument in declared}
        assert set(given) <= set(defaults)
        return declared, made.function({**defaults, **given})

    return run


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_every_argument_is_described(launch, path):
    declared, nodes = launch(path)
    assert all(argument.kind == 'DeclareLaunchArgument' for argument in declared)
    assert all(argument.description.strip() for argument in declared)
    assert nodes


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_executables_and_files_exist(launch, path):
    _, nodes = launch(path)
    setup = (ROOT / 'setup.py').read_text()
    for node in nodes:
        assert node.package == 'sgp_ros'
        assert f"'{node.executable} = sgp_ros." in setup
        assert all(Path(p).is_file() for p in node.parameters if isinstance(p, str))


NODE = ROOT / 'launch' / 'sgp.launch.py'


def test_an_empty_argument_overrides_nothing(launch):
    _, (node,) = launch(NODE, params_file='mine.yaml')
    assert node.parameters == ['mine.yaml']
    assert node.namespace is None
    assert node.prefix is None
    assert node.remappings == node.arguments == []
    assert not node.respawn
    assert node.executable == 'sgp_node'


def test_every_argument_reaches_the_node(launch):
    _, (node,) = launch(
        NODE, namespace='left', use_sim_time='true', robot='panda', command_type='none',
        record='a.mcap', respawn='true', managed='true', log_level='debug', command='/c',
        joint_states='/j', prefix='nice -n -5',
    )  # fmt: skip
    file, own = node.parameters
    assert file == str(ROOT / 'config' / 'panda.yaml')
    assert own == {
        'robot': 'panda', 'command.type': 'none', 'record.path': 'a.mcap', 'use_sim_time': True,
    }  # fmt: skip
    assert node.namespace == 'left'
    assert node.prefix == 'nice -n -5'
    assert node.remappings == [('joint_states', '/j'), ('command', '/c')]
    assert node.arguments == ['--ros-args', '--log-level', 'debug']
    assert node.respawn
    assert node.executable == 'sgp_lifecycle_node'


@pytest.mark.parametrize('name', ['respawn', 'managed', 'use_sim_time'])
def test_a_misspelt_switch_is_refused_in_one_line(launch, name):
    """It would be false in silence; launch prints the exception."""
    with pytest.raises(RuntimeError, match=f'{name}:=ture is neither true nor false'):
        launch(NODE, **{name: 'ture'})
    _, (node,) = launch(NODE, **{name: 'False'})
    assert not node.respawn
    assert node.executable == 'sgp_node'


def test_a_robot_without_a_shipped_file_needs_none(launch):
    _, (node,) = launch(NODE, robot='/my/arm.urdf')
    assert node.parameters == [{'robot': '/my/arm.urdf'}]


def test_the_arguments_of_the_bringup_page_are_those_of_the_launch_file(launch):
    page = (ROOT / 'docs' / 'bringup.md').read_text()
    declared, _ = launch(NODE)
    table = page.split('| launch argument |')[1].split('\n\n')[0]
    named = {
        name for row in table.splitlines()[2:] for name in re.findall('`(.+?)`', row.split('|')[1])
    }
    assert named == {argument.positional[0] for argument in declared}


def test_what_the_bringup_page_includes_in_a_launch_file_starts_the_node(launch):
    """The lines of the page, with stand-ins for what they import."""
    page = (ROOT / 'docs' / 'bringup.md').read_text()
    (code,) = re.findall(r'```python\n(IncludeLaunchDescription.*?)\n```', page, re.DOTALL)
    names = {
        n: _recorded(n) for n in ('IncludeLaunchDescription', 'PythonLaunchDescriptionSource')
    }
    names['FindPackageShare'] = lambda package: str(ROOT) if package == 'sgp_ros' else ''
    included = eval(code, names)
    path = ''.join(included.positional[0].positional[0])
    _, (node,) = launch(path, **dict(included.launch_arguments))
    assert node.respawn
    assert node.parameters == ['/my/sgp.yaml']
