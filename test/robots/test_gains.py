"""Gains of drives that hold position targets."""

import pytest

from sgp_ros.errors import ConfigError
from sgp_ros.robots.gains import read_gains

JOINTS = ('a', 'b')


def _read(tmp_path, text, actuated=JOINTS):
    path = tmp_path / 'gains.yaml'
    path.write_text(text, encoding='utf-8')
    return read_gains(path, JOINTS, actuated)


def test_gains_stand_in_the_order_of_the_joints(tmp_path):
    gains = _read(tmp_path, 'kp: {b: 2.0, a: 1}\nkd: {a: 0.1, b: 0}\nfeedforward: gravity\n')
    assert gains.kp.tolist() == [1.0, 2.0]
    assert gains.kd.tolist() == [0.1, 0.0]
    assert gains.holds_gravity


def test_joints_without_a_drive_have_no_gain(tmp_path):
    assert _read(tmp_path, 'kp: {a: 1.0}\nkd: {a: 0.1}\n', ('a',)).kp.tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('kp: [1, 2, 3]\nkd: [1, 2]\n', 'kp is 3 numbers without names'),
        ('kp: {a: 1}\nkd: {a: 1, b: 1}\n', "kp is given for \\['a'\\]"),
        ('kp: {a: 1, b: x}\nkd: {a: 1, b: 1}\n', "kp of b is 'x'"),
        ('kp: {a: 1, b: -1}\nkd: {a: 1, b: 1}\n', 'kp of b is -1'),
        ('kp: {a: 1, b: .nan}\nkd: {a: 1, b: 1}\n', 'kp of b is nan'),
        ('kp: {a: 1, b: 1.0e+308}\nkd: {a: 1, b: 1}\n', 'from 0 to 1e\\+30'),
        ('kp: {a: 1, b: 1}\nkd: {a: 1, b: 1}\nki: 3\n', 'the keys'),
        ('kp: {a: 1, b: 1}\nkd: {a: 1, b: 1}\nfeedforward: magic\n', "feedforward 'magic'"),
        ('- 1\n', 'not a mapping'),
        ('kp: [1, 2\n', 'gains'),
    ],
)
def test_anything_else_is_refused_by_name(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said):
        _read(tmp_path, text)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r'no\.yaml'):
        read_gains(tmp_path / 'no.yaml', JOINTS, JOINTS)
