"""Laws of the settings."""

from __future__ import annotations

import pytest

from sgp_ros.engine.config import EngineConfig
from sgp_ros.errors import ConfigError
from sgp_ros.robots.registry import load_robot

ROBOT = load_robot('reaction_wheel')


def _problems(**settings):
    values = {name.replace('__', '.'): value for name, value in settings.items()}
    with pytest.raises(ConfigError) as caught:
        EngineConfig.from_mapping(values, ROBOT)
    assert '\n' not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ('name', 'value', 'expected'),
    [
        ('filter.window', 'long', 'a number'),
        ('filter.window', -2.0, 'from -1 to 10'),
        ('filter.window', -0.5, '-1 to choose'),
        ('filter.window', float('nan'), 'a number'),
        ('filter.degree', 4.0, 'an integer'),
        ('filter.degree', True, 'an integer'),
        ('filter.velocity', 'guessed', 'auto, measured, position'),
        ('learning.enabled', 1, 'true or false'),
        ('command.joints', 'wheel', 'a list of strings'),
        ('command.joints', ['elbow'], 'elbow'),
        ('filter.window', 10**400, 'a number'),
        ('filter.windw', 0.1, 'unknown setting'),
        ('hyper.pole.lengthscales', [1.0, 2.0, 3.0], '2 positive'),
        ('hyper.pole.lengthscales', [1.0, 0.0], '2 positive'),
        ('hyper.elbow.noise_variance', 1.0, 'unknown setting'),
        ('model.residual_inputs', ['speed:pole'], 'velocity:pole'),
        ('model.residual_inputs', 3, 'a list of strings'),
    ],
)
def test_a_wrong_setting_is_refused_with_what_was_expected(name, value, expected):
    """Unknown names, wrong types, values out of range."""
    message = _problems(**{name.replace('.', '__'): value})
    assert name in message or 'speed:pole' in message
    assert expected in message


def test_all_wrong_settings_are_listed_at_once():
    """One error names every problem."""
    message = _problems(filter__window=-2.0, filter__degree='x', nonsense=1)
    assert message.startswith('3 wrong setting')
    for name in ('filter.window', 'filter.degree', 'nonsense'):
        assert name in message


def test_an_integer_is_a_number():
    """YAML writes 1 for 1.0; the type that the dataclass holds is a float."""
    config = EngineConfig.from_mapping({'filter.window': 1}, ROBOT)
    assert isinstance(config.filter_window, float)


def test_every_single_step_of_a_loaded_dump_is_consistent():
    """`param load` sets one parameter at a time: each step must be a valid configuration."""
    dump = {
        'hyper.pole.signal_variance': 2.0,
        'hyper.pole.lengthscales': [1.0, 2.0],
        'hyper.pole.noise_variance': 0.1,
        'buffer.budget': 50,
    }
    config = EngineConfig.from_mapping({}, ROBOT)
    for name, value in dump.items():
        config = config.changed({name: value}, ROBOT)
    assert config == EngineConfig.from_mapping(dump, ROBOT)
    assert not config.hyper[0].is_automatic
    assert config.hyper[1].is_automatic


def test_read_only_settings_take_only_their_present_value():
    """A dump that repeats them loads; another value is refused with the remedy."""
    config = EngineConfig.from_mapping({}, ROBOT)
    assert config.changed({'model.method': 'SGP'}, ROBOT) == config
    with pytest.raises(ConfigError, match='cannot change while running'):
        config.changed({'model.method': 'PR'}, ROBOT)
