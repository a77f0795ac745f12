"""Sentences of the node on the messages that arrive."""

from __future__ import annotations

from typing import Any

import pytest

from sgp_ros.engine.results import COMMAND_REFUSALS, REFUSALS
from sgp_ros.ros.verdict import ERROR, OK, WARN, Arrivals, judge


def _arrivals(**known: Any) -> Arrivals:
    return Arrivals('/arm/joint_states', '/arm/command', ('pole', 'wheel'), **known)


def test_all_is_well_when_every_state_is_used() -> None:
    assert judge(_arrivals(read=100, estimated=20)) == (OK, 'all joint states are used')


@pytest.mark.parametrize(
    ('known', 'level', 'words'),
    [
        ({}, WARN, ['no publisher on /arm/joint_states', 'remap']),
        ({'publishers': ('/a', '/b')}, WARN, ['no message on /arm/joint_states from 2']),
        ({'unreadable': 3, 'unreadable_reason': 'no names'}, ERROR, ['no names']),
        (
            {'read': 9, 'refused': {'unknown_joint': 9}, 'seen_joints': ('elbow',)},
            ERROR,
            ["['elbow']", "['pole', 'wheel']", 'set parameter robot'],
        ),
        (
            {'read': 9, 'refused': {'unpaired': 9}},
            ERROR,
            ['no command on /arm/command (0 publishers)', 'command.type'],
        ),
        ({'read': 9, 'refused': {'late': 8}}, ERROR, ['later', 'reorder_window']),
        (
            {
                'read': 9,
                'refused': {'unpaired': 9},
                'command_type': 'none',
                'without_effort': ('wheel',),
            },
            ERROR,
            ["no effort for joints ['wheel']", 'state_interface'],
        ),
        (
            {'received': 9, 'missing_joints': ('pole', 'wheel'), 'seen_joints': ('elbow',)},
            ERROR,
            ["['elbow']", "['pole', 'wheel']", 'robot file'],
        ),
        ({'received': 9, 'missing_joints': ('pole',)}, ERROR, ["contains the joints ['pole']"]),
        (
            {'received': 9, 'publishers': ('/a', '/b'), 'silent_joints': ('pole',)},
            WARN,
            ['9 messages', "['pole']", '/a, /b', 'stopped', 'start it again'],
        ),
        (
            {'read': 9, 'shared_joints': ('pole',), 'publishers': ('/a', '/b')},
            WARN,
            ["['pole']", '/a, /b'],
        ),
        (
            {'read': 90, 'received': 90, 'lost': 10, 'losing_joints': ('wheel',)},
            WARN,
            ['10 of 100', "['wheel']", 'qos.depth'],
        ),
        (
            {'read': 9, 'commands_read': 9, 'commands_refused': {'wrong_kind': 9}},
            ERROR,
            ['position targets', 'none'],
        ),
        (
            {'read': 9, 'commands_read': 9, 'commands_refused': {'wrong_length': 9}},
            ERROR,
            ['9 of 9 commands', 'command.joints'],
        ),
        (
            {
                'read': 9,
                'commands_read': 5,
                'refused': {'gap': 1, 'late': 2, 'clock': 0},
                'commands_refused': {'nonfinite': 1},
            },
            WARN,
            [
                "joints ['pole', 'wheel']",
                '1 of 9',
                'raise max_gap',
                '2 of 9',
                'reorder_window',
                '1 of 5 commands on /arm/command',
                'check the controller',
            ],
        ),
        (
            {'read': 9, 'unreadable': 1, 'unreadable_reason': 'x', 'publishers': ('/a',)},
            WARN,
            [
                '1 messages on /arm/joint_states or /arm/command could not be read: x',
                'correct the node',
                '/a',
            ],
        ),
        ({'read': 100, 'estimated': 0}, WARN, ['100 ', "['pole', 'wheel']", 'filter.window']),
    ],
)
def test_the_sentence_says_what_was_found_and_what_to_do(
    known: dict[str, Any], level: int, words: list[str]
) -> None:
    found, sentence = judge(_arrivals(**known))
    assert found == level
    assert [word for word in words if word not in sentence] == []


@pytest.mark.parametrize('reason', REFUSALS)
def test_every_reason_for_which_states_are_refused_has_a_remedy(reason: str) -> None:
    for read in (1, 9):
        level, sentence = judge(_arrivals(read=read, refused={reason: 1}))
        assert level == (ERROR if read == 1 else WARN)
        assert 'see docs' not in sentence
        assert f'1 of {read} joint states' in sentence
        assert "['pole', 'wheel']" in sentence


@pytest.mark.parametrize('reason', COMMAND_REFUSALS)
def test_every_reason_for_which_commands_are_refused_is_named(reason: str) -> None:
    for read in (1, 9):
        level, sentence = judge(_arrivals(read=9, commands_read=read,
                                          commands_refused={reason: 1}))  # fmt: skip
        assert level == (ERROR if read == 1 else WARN)
        assert reason in sentence
        assert 'see docs' not in sentence
        assert "['pole', 'wheel']" in sentence
