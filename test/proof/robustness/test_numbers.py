"""Numbers and keys of strangers' files that computations would stumble over."""

from __future__ import annotations

import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.errors import ConfigError
from sgp_ros.markup import YAMLError, load_yaml
from sgp_ros.recordings.model_files import load_parameters
from sgp_ros.recordings.table_map import read_map
from sgp_ros.robots.gains import read_gains
from sgp_ros.robots.registry import load_robot

LARGE = '1' + '0' * 400


@pytest.mark.parametrize(
    ('read', 'text'),
    [
        (load_parameters, '/**:\n  ros__parameters:\n    filter.window: {}\n'),
        (read_map, 'time: {{rate: {}}}\n'),
        (lambda path: read_gains(path, ('a',), ('a',)), 'kp: {{a: {}}}\nkd: {{a: 1}}\n'),
        (lambda path: load_robot(str(path)), 'schema: 1\nurdf: r.urdf\neffort_gain: {{a: {}}}\n'),
    ],
)
def test_integers_that_no_float_holds_are_refused(tmp_path, read, text):
    path = tmp_path / 'x.yaml'
    path.write_text(text.format(LARGE))
    with pytest.raises(ConfigError, match=r'an integer of 401 characters in line \d') as caught:
        read(path)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('key', ['"a"', '"1"', '? a\n'])
def test_a_key_that_stands_there_twice_is_refused(key):
    """The first would be lost; what an anchor brings may be replaced."""
    with pytest.raises(YAMLError, match=r"the key '[a1]' is repeated in line 4"):
        load_yaml(f'x: 1\na: [{{a: 1}}, a, *a]\n1: &a {{a: 2}}\n{key}: 2\n'.replace(', *a', ''))
    assert load_yaml('a: &x {b: 1, c: 2}\nd: {<<: *x, b: 3}\n')['d'] == {'b': 3, 'c': 2}


def test_a_setting_of_an_integer_that_no_float_holds_is_refused():
    """As a recorded change may state it."""
    robot = load_robot('reaction_wheel')
    for name in ('filter.window', 'hyper.pole.length_scales'):
        with pytest.raises(ConfigError, match=name):
            EngineConfig.from_mapping({name: int(LARGE)}, robot)


URDF = """<robot name="x"><link name="b"/><joint name="a" type="revolute"><parent link="b"/>
<child link="r"/><origin xyz="{place} 0 0"/><axis xyz="0 0 1"/><limit lower="-2" upper="{upper}"
velocity="9" effort="9"/><dynamics damping="{damping}"/></joint><link name="r"><inertial>
<origin xyz="0.1 0 0"/><mass value="{mass}"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
iyz="0"/></inertial></link></robot>"""
GIVEN = {'place': '0', 'upper': '2', 'damping': '0.1', 'mass': '1'}


@pytest.mark.parametrize('what', ['place', 'damping', 'mass'])
def test_numbers_of_a_urdf_beyond_what_products_hold_are_refused(tmp_path, what):
    path = tmp_path / 'x.urdf'
    path.write_text(URDF.format(**{**GIVEN, what: '1e308'}))
    with pytest.raises(ConfigError, match=r'1e308.*a finite number up to 1e\+30'):
        load_robot(str(path))
    path.write_text(URDF.format(**{**GIVEN, what: '-1e-320'}))
    load_robot(str(path))  # as without


def test_a_limit_beyond_all_numbers_is_none(tmp_path):
    """As programs write it that know of no other way."""
    path = tmp_path / 'x.urdf'
    path.write_text(URDF.format(**{**GIVEN, 'upper': '1.79769e+308'}))
    assert load_robot(str(path)).joints[0].upper == float('inf')


@pytest.mark.parametrize(
    'entry',
    [
        'effort_gain: {a: 1.0e+308}', 'effort_gain: {a: 1.0e-308}', 'coulomb_width: 1.0e-308',
        'parameters: {a.coulomb: {value: 1.0e+308}}',
        'parameters: {a.coulomb: {value: 1.0, std: 1.0e-308}}',
        'payload: {link: r, mass: 1.0e+308}', 'prior: {inertial: {spread: 1.0e+308}}',
        'effects: [{effect: spring, joint: a, parameters: {stiffness: {value: 1.0e+308}}}]',
    ],
)  # fmt: skip
def test_numbers_of_a_robot_file_beyond_what_products_hold_are_refused(tmp_path, entry):
    (tmp_path / 'x.urdf').write_text(URDF.format(**GIVEN))
    path = tmp_path / 'x.yaml'
    path.write_text(f'schema: 1\nurdf: x.urdf\n{entry}\n')
    with pytest.raises(ConfigError, match=r'1e[+-]308') as caught:
        load_robot(str(path))
    assert '\n' not in str(caught.value)
