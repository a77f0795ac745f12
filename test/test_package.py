"""The package as it is installed."""

from __future__ import annotations

import os
import re
import runpy
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path

import pytest

import sgp_ros
from sgp_ros.robots.shipped import find_shipped

ROOT = Path(__file__).parents[1]


def test_versions_agree():
    """package.xml, setup.py, the package and the changelog name one version."""
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    setup = (ROOT / 'setup.py').read_text()
    assert manifest.findtext('version') == sgp_ros.__version__
    assert f"VERSION = '{sgp_ros.__version__}'" in setup
    changelog = (ROOT / 'CHANGELOG.rst').read_text()
    assert re.search(rf'^{re.escape(sgp_ros.__version__)} ', changelog, re.MULTILINE)


def test_entry_points_exist():
    """Every console script leads to a function."""
    setup = (ROOT / 'setup.py').read_text()
    scripts = re.findall(r"'(\w+) = ([\w.]+):(\w+)'", setup)
    assert {name for name, _, _ in scripts} == {
        'sgp', 'sgp_node', 'sgp_lifecycle_node', 'reaction_wheel',
    }  # fmt: skip
    for _, module, function in scripts:
        assert callable(getattr(import_module(module), function))


def _given_to_setuptools(folder, monkeypatch):
    """Return what setup.py in `folder` tells setuptools."""
    given = {}
    monkeypatch.chdir(folder)
    monkeypatch.setattr('setuptools.setup', given.update)
    runpy.run_path(str(folder / 'setup.py'))
    return given


def test_experiments_bring_their_commands_and_are_not_needed(tmp_path, monkeypatch):
    """With the folder `sgp_proof` there are entry points for its commands, without it none."""
    given = _given_to_setuptools(ROOT, monkeypatch)
    (entry,) = given['entry_points']['sgp_ros.commands']
    module, function = entry.split(' = ')[1].split(':')
    assert callable(getattr(import_module(module), function))
    for name in ('setup.py', 'README.md', 'package.xml'):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / 'sgp_ros', tmp_path / 'sgp_ros')
    alone = _given_to_setuptools(tmp_path, monkeypatch)
    assert not alone['entry_points']['sgp_ros.commands']
    assert {name.split('.')[0] for name in alone['packages']} == {'sgp_ros'}


def test_every_requirement_stands_in_the_manifest(monkeypatch):
    """A user of rosdep gets what a user of pip gets."""
    keys = {
        'numpy': 'python3-numpy', 'scipy': 'python3-scipy', 'numba': 'python3-numba',
        'pyyaml': 'python3-yaml', 'jinja2': 'python3-jinja2', 'matplotlib': 'python3-matplotlib',
        'pin': 'pinocchio', 'lz4': 'python3-lz4',
    }  # fmt: skip
    manifest = ET.parse(ROOT / 'package.xml').getroot()
    present = {entry.text for entry in manifest.findall('exec_depend')}
    required = {
        re.split('[<>=]', text)[0]
        for text in _given_to_setuptools(ROOT, monkeypatch)['install_requires']
    }
    assert {keys.get(name, f'python3-{name}-pip') for name in required} <= present


def test_shipped_files_are_found_from_the_source_tree():
    """`make demo` runs from an editable install, where no share folder exists."""
    assert find_shipped('quick_discovery.xml') is not None
    assert find_shipped('nothing.yaml') is None


@pytest.fixture(
    scope='module',
    params=[
        pytest.param((), id='copied'),
        pytest.param(('--symlink-install',), id='linked', marks=pytest.mark.long),
    ],
)
def workspace(request, tmp_path_factory):
    """A colcon workspace that holds a copy of the sources, built."""
    folder = tmp_path_factory.mktemp('workspace')
    source = folder / 'src' / 'sgp_ros'
    ignored = shutil.ignore_patterns(
        '.*', 'out', 'build', 'install', 'log', '*.egg-info', '__pycache__'
    )
    shutil.copytree(ROOT, source, ignore=ignored)
    colcon = shutil.which('colcon', path=f'{Path(sys.executable).parent}:{os.environ["PATH"]}')
    assert colcon, 'colcon comes with the test extra'
    done = subprocess.run(
        [colcon, 'build', '--event-handlers', 'console_direct+', *request.param],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_colcon_build_installs_what_a_workspace_needs(workspace):
    """Index entry, manifest, launch and configuration files are in share, executables in lib."""
    prefix = workspace / 'install' / 'sgp_ros'
    share = prefix / 'share' / 'sgp_ros'
    assert (prefix / 'share/ament_index/resource_index/packages/sgp_ros').is_file()
    assert (share / 'package.xml').is_file()
    for folder in ('launch', 'config', 'bags'):
        for path in (ROOT / folder).rglob('*'):
            if path.is_file() and '__pycache__' not in path.parts:
                assert (share / path.relative_to(ROOT)).is_file(), path
    for name in ('sgp', 'sgp_node', 'sgp_lifecycle_node', 'reaction_wheel'):
        assert (prefix / 'lib' / 'sgp_ros' / name).is_file()


def run_in(workspace, *command):
    """Run a command as a user does who has sourced the workspace."""
    done = subprocess.run(
        ['sh', '-c', '. install/setup.sh && exec "$@"', 'sh', *command],
        cwd=workspace, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_an_executable_built_by_colcon_runs(workspace):
    """The installed `sgp` imports the installed package and finds the installed configuration."""
    command = workspace / 'install' / 'sgp_ros' / 'lib' / 'sgp_ros' / 'sgp'
    assert 'usage: sgp' in run_in(workspace, command, '--help')
    run_in(workspace, command, 'simulate', 'reaction_wheel', '--duration', '1')
    assert (workspace / 'out' / 'simulate' / 'reaction_wheel.mcap').is_file()
    text = 'import sgp_ros.robots.shipped as p; print(p.find_shipped("linear_axis.yaml"))'
    found = run_in(workspace, sys.executable, '-c', text).strip()
    assert Path(found).is_relative_to(workspace)
