"""Meaning of the name of a column: a quantity, a joint, a unit, measured or asked for.

Names are cut into words at dots, slashes, underscores, brackets, changes of case, before digits
and between two known words, as in `actcur`. Words that name a quantity, a unit or a target, in
English or German, are taken out; what is left names the joint.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

TIME, POSITION, VELOCITY, EFFORT, CURRENT = 'time', 'position', 'velocity', 'effort', 'current'
DUTY, COMMAND, KP, KD, OTHER = 'duty', 'command', 'kp', 'kd', 'other'
STATE = 'state'
"""Of a joint, its position, where nothing else says more; of a program, a number."""

_QUANTITIES = {
    TIME: 't ts time times timestamp timestamps stamp stamps sec secs seconds clock zeit',
    POSITION: 'q qs pos position positions qpos ang angle angles theta phi psi alpha beta '
    'encoder enc winkel lage',
    VELOCITY: 'dq qd qdot vel velocity velocities qvel dtheta dphi dalpha omega speed thetadot '
    'phidot alphadot rate geschwindigkeit drehzahl',
    EFFORT: 'tau taus torque torques effort efforts eff effs force forces qfrc load moment trq '
    'drehmoment kraft',
    CURRENT: 'i iq cur current currents amps curr strom',
    DUTY: 'pwm duty',
    KP: 'kp stiffness pgain',
    KD: 'kd dgain',
    OTHER: 'ddq qdd qddot acc accel acceleration accelerations qacc temperature temp voltage '
    'index frame episode task reward done error ff feedforward tcp eef cartesian wrench ext '
    'external execution scaling fraction momentum',
}
_WORDS = {word: role for role, words in _QUANTITIES.items() for word in words.split()}
_EFFORTS = frozenset(_QUANTITIES[EFFORT].split())
_SYMBOLS = {'M': EFFORT, 'F': EFFORT}
"""Those that are capitals."""
_TARGETS = frozenset({
    'des', 'desired', 'cmd', 'command', 'commands', 'commanded', 'target', 'targets', 'ref',
    'reference', 'setpoint', 'goal', 'action', 'actions', 'ctrl', 'control', 'u', 'sp', 'd',
    'soll', 'set',
})  # fmt: skip
_PLAIN_TARGETS = _TARGETS - {'d'}
_UNITS = {
    's': 's', 'ms': 'ms', 'us': 'us', 'ns': 'ns', 'nsec': 'ns', 'nanosec': 'ns', 'msec': 'ms',
    'rad': 'rad', 'radians': 'rad', 'deg': 'deg', 'degs': 'deg', 'degree': 'deg',
    'degrees': 'deg', 'grad': 'deg', 'rev': 'rev', 'turns': 'rev', 'm': 'm', 'mm': 'mm',
    'rpm': 'rpm',
    'nm': 'N m', 'mnm': 'mN m', 'knm': 'kN m', 'n': 'N', 'kn': 'kN', 'mn': 'mN',
    'a': 'A', 'ma': 'mA', 'ticks': 'counts', 'pct': '%', 'percent': '%',
    'prozent': '%', 'permille': '‰', 'permil': '‰', 'promille': '‰',
    'counts': 'counts', 'nmm': 'N mm', 'ncm': 'N cm', 'kgfcm': 'kgf cm', 'kgcm': 'kgf cm',
}  # fmt: skip
_PER_SECOND = {'degps': 'deg', 'dps': 'deg', 'radps': 'rad', 'mmps': 'mm', 'mps': 'm'}
_PREFIXED = r'(?<![A-Za-z])[mk](N|Nm|Nmm|A)(?![A-Za-z])'
"""Units with a capital inside, which begins no word."""
_LONG_UNITS = frozenset({
    'rad', 'deg', 'degrees', 'rpm', 'counts', 'ticks', 'mm', 'nm', 'nmm', 'ncm', 'kgfcm', 'kgcm',
    'mnm', 'knm',
    'ms', 'ns', 'us', 'pct', 'percent', 'prozent', 'permille', 'permil', 'promille',
})  # fmt: skip
"""Units that nothing else means, wherever they stand."""
_FILLER = frozenset({
    'joint', 'joints', 'states', 'observation', 'obs', 'data', 'msg', 'robot', 'motor', 'actual',
    'measured', 'meas', 'act', 'raw', 'list', 'sensor', 'log', 'the', 'value', 'values', 'j',
    'ist', 'est', 'estimated',
})  # fmt: skip
_KNOWN = frozenset({w for w in {*_WORDS, *_FILLER, *_TARGETS} if len(w) > 2 or w == 'j'})
"""Words that are seen where they stand close to another one, as in `jpos`."""
_PAIRS = {('p', 'gain'): KP, ('d', 'gain'): KD, ('q', 'dot'): VELOCITY,
          ('q', 'ddot'): OTHER, ('d', 'q'): VELOCITY, ('feed', 'forward'): OTHER}  # fmt: skip
_PAIRS |= {(angle, 'dot'): VELOCITY for angle in ('theta', 'phi', 'psi', 'alpha', 'beta')}
_PAIRS |= {(now, what): POSITION for now in ('cur', 'curr', 'current')
           for what in ('pos', 'position', 'positions', 'angle', 'angles', 'state')}  # fmt: skip
_OF_TIME = frozenset({'', 's', 'ms', 'us', 'ns'})


@dataclass(frozen=True, slots=True)
class Meaning:
    """Meaning of a name.

    Attributes:
        role: the quantity; `command` where only that it is asked for, `state` where only that it
            is one; empty for nothing known.
        is_target: whether it is asked for, not measured.
        rest: words that are left, in their order.
        unit: as in a map; empty where none is said.
    """

    role: str
    is_target: bool
    rest: tuple[str, ...]
    unit: str

    @property
    def joint(self) -> str:
        """Rest of the name, without words that mean nothing beside others."""
        return '_'.join(w for w in self.rest if w.lower() not in _FILLER)


def meaning(name: str, joints: Iterable[str] = ()) -> Meaning:
    """Return what the name of a column says.

    Args:
        name: of the column.
        joints: names of known joints: beside other words they mean nothing else, as `U` and `T`.
    """
    words, unit = _unit(_words(name))
    role, is_target, is_state = '', False, False
    rest: list[str] = []
    own, i = _own(words, unit, joints), 0
    while i < len(words):
        if i in own:
            rest.append(words[i])
            i += 1
            continue
        word = words[i].lower()
        pair = (word, words[i + 1].lower()) if i + 1 < len(words) else None
        if pair in _PAIRS:
            role = _stronger(role, _PAIRS[pair])
            i += 2
            continue
        if word in _PLAIN_TARGETS or (word == 'd' and i and role):
            is_target = True
        elif word in _WORDS and not (word in {'i', 'd', 't', 'index'} and role):
            role = _stronger(role, _WORDS[word])
        elif words[i] in _SYMBOLS:
            role = _stronger(role, _SYMBOLS[words[i]])
        elif word == STATE:
            is_state = True
        else:
            rest.append(words[i])
        i += 1
    if not role:
        role = STATE if is_state else COMMAND if is_target else ''
    if not unit and _EFFORTS & {word.lower() for word in words} == {'load'}:
        unit = '%'  # as servos log it, of the duty cycle: no torque
    return Meaning(role, is_target, tuple(rest), unit)


def _own(words: list[str], unit: str, joints: Iterable[str]) -> range:
    """Return where words name a joint; empty where they are all there is, and may be a time.

    `joint_t` is also met as `T`.
    """
    names = sorted(map(_words, joints), key=len, reverse=True)
    bare = [[w.upper() for w in name if w.lower() not in _FILLER] for name in names]
    letters = [name for name in bare if len(name) == 1 and name[0].isalpha()]
    for joint in (*names, *letters):
        for i in range(len(words) - len(joint) + 1):
            is_all = len(words) == len(joint) and unit in _OF_TIME
            if joint and words[i : i + len(joint)] == joint and not is_all:
                return range(i, i + len(joint))
    return range(0)


def _stronger(before: str, found: str) -> str:
    """Return which of two quantities a name means: a velocity of an angle is a velocity."""
    if not before or OTHER in {before, found}:
        return OTHER if before and OTHER in {before, found} else found
    order = (KP, KD, VELOCITY, EFFORT, CURRENT, DUTY, POSITION, TIME)
    return min((before, found), key=order.index)


def _words(name: str) -> list[str]:
    bare = re.sub(_PREFIXED, lambda unit: unit[0].lower(), name)
    bare = re.sub(r'([a-z])([A-Z])|([A-Z])([A-Z][a-z]{2})', r'\1\3 \2\4', bare)
    for sign, unit in (('%', ' pct '), ('‰', ' permille '), ('°(?!C)', ' deg ')):
        bare = re.sub(sign, unit, bare)
    bare = re.sub(r'([A-Za-z])(\d)', r'\1 \2', bare)
    return [part for word in re.split(r'[^A-Za-z0-9]+', bare) if word for part in _parts(word)]


def _parts(word: str) -> list[str]:
    """Return two known words, one of which is a quantity, that are one word; or the word."""
    low = word.lower()
    if low in _KNOWN or low in _UNITS:
        return [word]
    for i in (1, *range(3, len(low) - 2)):
        both = {low[:i], low[i:]}
        if both <= _KNOWN and both & _WORDS.keys():
            return [word[:i], word[i:]]
    return [word]


def _unit(words: list[str]) -> tuple[list[str], str]:
    """Return the words without a unit behind them, and the unit, such as `rad s` for rad/s."""
    ends = [w.lower() for w in words[-2:]]
    if len(words) > 1 and ends[-1] in _PER_SECOND:
        return words[:-1], f'{_PER_SECOND[ends[-1]]}/s'
    if len(words) > 1 and ends[-1] == 's' and ends[0] in _UNITS:
        unit = _UNITS[ends[0]]
        if unit in {'rad', 'deg', 'rev', 'm', 'mm', 'counts'}:
            return words[:-2], f'{unit}/s'
    if len(words) > 2 and ends[-1] == 'm' and ends[0] in {'n', 'kn', 'mn'}:
        return words[:-2], f'{_UNITS[ends[0]]} m'
    if len(words) > 1 and words[-1].lower() in _UNITS and words[-1] != 'a':
        return words[:-1], _UNITS[words[-1].lower()]
    inside = [i for i, w in enumerate(words) if w.lower() in _LONG_UNITS]
    if len(inside) == 1 and len(words) > 1:
        at = inside[0]
        return words[:at] + words[at + 1 :], _UNITS[words[at].lower()]
    return words, ''
