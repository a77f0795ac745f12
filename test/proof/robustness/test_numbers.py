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
    with pytest.raises(YAMLError, match=r"the key '[a1]' stands there again in line 4"):
        load_yaml(f'x: 1\na: [{{a: 1}}, a, *a]\n1: &a {{a: 2}}\n{key}: 2\n'.replace(', *a', ''))
    assert load_yaml('a: &x {b: 1, c: 2}\nd: {<<: *x, b: 3}\n')['d'] == {'b': 3, 'c': 2}


def test_a_setting_of_an_integer_that_no_float_holds_is_refused():
    """As a recorded change may state it."""
    robot = load_robot('reaction_wheel')
    for name in ('filter.window', 'hyper.pole.length_scales'):
        with pytest.raises(ConfigError, match=name):
            EngineConfig.from_mapping({name: int(LARGE)}, robot)
