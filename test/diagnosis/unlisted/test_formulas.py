"""Formulas that follow the data of a smooth force, and the laws that a whole search finds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sgp_ros.diagnosis.decide.decision import decide
from sgp_ros.diagnosis.explain.comparison import compare_models
from sgp_ros.diagnosis.unlisted.assertion import with_laws
from sgp_ros.diagnosis.unlisted.beside import law_of
from sgp_ros.diagnosis.unlisted.curves import Curve, follow, hats, left_out
from sgp_ros.diagnosis.unlisted.formulas import Range
from sgp_ros.diagnosis.unlisted.sentences import of_position, of_velocity, sums
from sgp_ros.physics.formula import read_formula
from test.diagnosis.worlds import CHAINS, simulate


class _Play:
    """A spring behind play: it holds its place until either end takes it along."""

    half = 0.25

    def __init__(self):
        self.z = None

    def __call__(self, _t, q, _v):
        z = q[0] if self.z is None else self.z
        self.z = min(max(z, q[0] - self.half), q[0] + self.half)
        return (-1.2 * self.z,)


def _log_friction(_t, _q, v):
    return (-0.5 * math.copysign(math.log1p(abs(v[0]) / 0.4), v[0]),)


def _brake_and_friction(_t, _q, v):
    return (-0.8 * v[0] / (1.0 + (v[0] / 1.5) ** 2) - 0.3 * math.tanh(v[0] / 0.01),)


def _contact(_t, q, _v):
    return (-2.0 * max(q[0] - 0.3, 0.0) ** 1.5,)


def _spring_between(_t, q, _v):
    return (-0.8 * (q[0] - q[1]) ** 3, 0.0)


def _hose(_t, q, _v):
    return (-0.8 * (q[0] + 0.6 * q[1]) ** 3, 0.0)


def _cushion(_t, q, v):
    return (-1.5 * max(q[0] - 0.3, 0.0) * max(v[0], 0.0),)


def _unbalanced(_t, q, v):
    return (0.3 * v[0] ** 2 * math.sin(4.0 * (q[0] - 0.2)),)


def _valve(_t, q, v):
    return (-0.8 * (1.0 + math.tanh((q[1] - 0.1) / 0.03)) * v[0], 0.0)


def _cable(_t, q, _s):
    return 0.3 * math.exp(0.6 * q[0])


def _jet(_t, _q, v):
    return (0.4 * max(1.3 - v[0], 0.0) ** 2,)


def _shield(_t, q, v):
    return (-6.0 * math.sin(2.5 * q[0] + 0.4) / (1.0 + (v[0] / 1.4) ** 2), 0.0)


def _found(equations_for, links, **what):
    _, equations = equations_for(simulate(CHAINS[links], 11, 10.0, **what))
    comparison = compare_models(equations, lambda _share: None)
    model = with_laws(equations, comparison, decide(equations, comparison)).decision.model
    law = law_of(model, 0)
    assert law is not None, [s.name for s in model.effects]
    assert model.effects == (law,)
    return law.effect.formula.partition(' = ')[2], law.report(equations.motion)


@pytest.mark.parametrize(
    ('force', 'links', 'formula', 'numbers'),
    [
        pytest.param(
            _log_friction, 1, 'a*log(1 + abs(dq[joint0])/v0)*sign(dq[joint0])',
            {'a': -0.5, 'v0': 0.4}, marks=pytest.mark.long,
        ),
        pytest.param(
            _brake_and_friction, 1,
            'a*dq[joint0]/(1 + (dq[joint0]/v0)**2) + d*tanh(dq[joint0]/v_s)',
            {'a': -0.8, 'v0': 1.5, 'd': -0.3}, marks=pytest.mark.long,
        ),
        pytest.param(
            _valve, 2, '(a*tanh((q[joint1] - x0)/w0) + d)*dq[joint0]',
            {'a': -0.8, 'x0': 0.1, 'd': -0.8}, marks=pytest.mark.long,
        ),
        pytest.param(
            _jet, 1, 'a*max(x0 - dq[joint0], 0)**2', {'a': 0.4, 'x0': 1.3},
            marks=pytest.mark.long,
        ),
        pytest.param(
            _shield, 2, 'a*1/(1 + ((dq[joint0] - x0)/w0)**2)*sin(n0_f*(q[joint0] - x0_f))',
            {'w0': 1.4, 'n0_f': 2.5}, marks=pytest.mark.long,
        ),
        pytest.param(
            _contact, 1, 'a*(max(q[joint0] - x0, 0)/r)**p0', {'p0': 1.5, 'x0': 0.3},
            marks=pytest.mark.long,
        ),
        pytest.param(
            _Play(), 1, 'a*play(q[joint0], T)', {'a': -1.2, 'T': 0.5}, marks=pytest.mark.long
        ),
        pytest.param(
            _spring_between, 2, 'a*(q[joint0] - q[joint1])**3', {'a': -0.8},
            marks=pytest.mark.long,
        ),
        pytest.param(
            _hose, 2, 'a*(q[joint0] + R*q[joint1])**3', {'a': -0.8, 'R': 0.6},
            marks=pytest.mark.long,
        ),
        pytest.param(
            _cushion, 1, 'a*max(q[joint0] - x0, 0)*max(dq[joint0], 0)', {'a': -1.5, 'x0': 0.3},
            marks=pytest.mark.long,
        ),
        pytest.param(
            _unbalanced, 1, 'a*sin(n0*(q[joint0] - x0))*dq[joint0]**2', {'n0': 4.0},
            marks=pytest.mark.long,
        ),
    ],
    ids=['log friction', 'brake and friction', 'valve', 'jet', 'shield', 'contact', 'play',
         'spring between', 'hose', 'cushion', 'unbalanced'],
)  # fmt: skip
def test_laws_are_found_with_their_numbers(equations_for, force, links, formula, numbers):
    """Of one joint, of what it did before, of two joints; alone and in a sum."""
    found, values = _found(equations_for, links, force=force)
    assert found == formula
    for name, value in numbers.items():
        assert values[name] == pytest.approx(value, rel=0.02), name


@pytest.mark.long
def test_dry_friction_of_any_form_holds_a_joint_at_rest(equations_for):
    """Rows in which a cable holds its joint ask nothing of its law, nor of its rivals."""
    found, values = _found(equations_for, 1, dry=_cable)
    assert found == 'a*exp(q[joint0]/w0)*sign(dq[joint0])'
    assert values['a'] == pytest.approx(-0.3, rel=0.01)
    assert values['w0'] == pytest.approx(1.0 / 0.6, rel=0.01)


@pytest.mark.parametrize('factor', [1.0, 3.0])
def test_a_curve_says_what_a_formula_leaves_of_all_rows(factor):
    """As least squares on the rows themselves do, filtered ones too."""
    rng = np.random.default_rng(0)
    at = rng.uniform(-1.0, 2.0, 3000)
    nodes = np.linspace(at.min(), at.max(), 241)

    def rows(force):
        return factor * (force[:-2] + 2.0 * force[1:-1] + force[2:])[::3]

    true = 0.7 * np.tanh((at - 0.3) / 0.4) + 0.2
    y = rows(true[:, None])[:, 0] + rng.normal(0.0, 0.01, 1000)
    curve = Curve.of(nodes, hats(nodes, rows, at), y)
    ranges = {'x0': (-1.0, 2.0), 'w0': (0.05, 5.0)}
    read = read_formula('a*tanh((q[X] - x0)/w0) + d', is_law=True)
    right = follow(read, curve, ranges)
    assert right is not None
    assert right.numbers['x0'] == pytest.approx(0.3, abs=0.01)
    assert right.numbers['w0'] == pytest.approx(0.4, abs=0.01)
    straight = follow(read_formula('a*q[X] + d', is_law=True), curve, {})
    assert straight is not None
    X = rows(np.column_stack([at, np.ones_like(at)]))
    left = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    assert straight.left + curve.rest == pytest.approx(left @ left, rel=1e-3)
    assert right.left + curve.rest == pytest.approx(1000 * 1e-4, rel=0.15)


def test_a_gate_of_a_fiftieth_of_the_range_has_a_width():
    """No end of what is searched decides what follows a curve that shows it."""
    nodes, seen = np.linspace(-1.0, 1.0, 101), Range(-1.0, 1.0, 'rad')
    curve = Curve(nodes, np.eye(101), np.tanh((nodes - 0.3) / 0.04), 0.0)
    read = read_formula('a*tanh((q[X] - x0)/w0)', is_law=True)
    found = follow(read, curve, {name: seen.ends(name)[:2] for name in ('x0', 'w0')})
    assert found is not None
    assert found.numbers['w0'] == pytest.approx(0.04, rel=1e-3)


@pytest.mark.parametrize(
    ('text', 'numbers'),
    [
        ('a*max(sin(n0*(X - x0)), 0)', {'n0': 5.0, 'x0': 0.2}),
        ('a*abs(sin(n0*(X - x0)))', {'n0': 5.0, 'x0': 0.2}),
        ('a*abs(sin(n0*(X - x0)))*sin(n0*(X - x0))', {'n0': 5.0, 'x0': 0.2}),
        ('a*sin(n0*(X - x0))*exp(p0*cos(n0*(X - x0)))', {'n0': 5.0, 'x0': 0.2, 'p0': 1.5}),
        ('a*(1 + ((X - x0)/w0)**2)**(-p0)', {'x0': 0.1, 'w0': 0.4, 'p0': 1.5}),
        ('a*(X - x0)*(1 + ((X - x0)/w0)**2)**(-p0)', {'x0': 0.1, 'w0': 0.4, 'p0': 2.5}),
        ('a*max(X - x0, 0)', {'x0': 0.3}),
        ('a*max(x0 - X, 0)', {'x0': 0.3}),
        ('a*X**2/(1 + (X/v0)**2)', {'v0': 0.6}),
        ('a*max(tanh(X/v0), 0)', {'v0': 0.15}),
        ('a*min(tanh(X/v0), 0)', {'v0': 0.15}),
        ('a*X*tanh((abs(X) - v0)/w0)', {'v0': 0.4, 'w0': 0.1}),
        ('a*tanh((abs(X) - v0)/w0)', {'v0': 0.4, 'w0': 0.1}),
        ('a*max(1 - (X/v0)**2, 0)*sign(X)', {'v0': 0.6}),
        ('a*min(max(w0 - abs(X - x0), 0)/w2, 1)', {'x0': 0.1, 'w0': 0.5, 'w2': 0.15}),
        ('a*sin(n0*(X - x0))**2', {'n0': 1.1, 'x0': -0.6}),
        (
            'a*(((o0 - X)/r)**(-p0) - ((X - u0)/r)**(-p0))',
            {'o0': 1.3, 'u0': -1.4, 'p0': 2.0, 'r': 1.0},
        ),
    ],
)
def test_a_text_follows_its_own_curve(text, numbers):
    """Half waves, poles of magnets, fields of coils, thresholds and saturated squares of speed.

    And friction of a part of the speeds, a force within an interval, one that grows at both
    ends, a damper on a crank.
    """
    seen, nodes = Range(-1.0, 1.0, 'rad'), np.linspace(-1.0, 1.0, 101)
    is_speed = 'v0' in numbers
    assert text in set(of_velocity(is_own=True) if is_speed else of_position())
    formula = read_formula(text.replace('X', 'q[X]'), is_law=True)
    force = read_formula(text.replace('X', 'x_'), is_law=True)
    y = np.array([force.value({**numbers, 'a': -0.7, 'x_': x}) for x in nodes.tolist()])
    found = follow(formula, Curve(nodes, np.eye(101), y, 0.0),
                   {name: seen.ends(name)[:2] for name in numbers})  # fmt: skip
    assert found is not None
    assert found.left < 1e-4 * (y @ y)
    turn = 2.0 * math.pi / numbers.get('n0', 1e-9)
    for name, value in numbers.items():
        off = found.numbers[name] - value
        assert abs((off + turn / 2) % turn - turn / 2 if name == 'x0' else off) < 0.02, name


@pytest.mark.parametrize('text', ['a*sin(n0*(X - x0))', 'a*max(sin(n0*(X - x0)), 0)'])
def test_waves_are_followed_from_any_phase(text):
    """Of a third of a period to three and a half, wherever the joint moves."""
    rng = np.random.default_rng(0)
    formula = read_formula(text.replace('X', 'q[X]'), is_law=True)
    force = read_formula(text.replace('X', 'x_'), is_law=True)
    for _ in range(60):
        middle, half = rng.uniform(-2.0, 2.0), rng.uniform(0.5, 3.0)
        seen = Range(middle - half, middle + half, 'rad')
        nodes = np.linspace(seen.low, seen.high, 101)
        n0 = math.exp(rng.uniform(math.log(0.3), math.log(3.5))) * math.pi / half
        numbers = {'a': 1.0, 'n0': n0, 'x0': rng.uniform(seen.low, seen.high)}
        y = np.array([force.value({**numbers, 'x_': x}) for x in nodes.tolist()])
        ends = {name: seen.ends(name)[:2] for name in ('n0', 'x0')}
        found = follow(formula, Curve(nodes, np.eye(101), y, 0.0), ends)
        assert found is not None
        assert found.left < 1e-4 * (y @ y)


def test_a_force_between_nodes_is_judged_on_parts_left_out():
    """Stiction in poses that come once follows them, and says nothing of others; a wave does."""
    rng = np.random.default_rng(3)
    rest = np.repeat(rng.uniform(0.0, 1.0, 60), 30)
    nodes, part = np.linspace(0.0, 1.0, 41), np.arange(1800) // 150 % 6
    L = hats(nodes, lambda force: force, rest)
    held = np.repeat(rng.normal(0.0, 1.0, 60), 30)
    fitted = held - L @ np.linalg.lstsq(L, held, rcond=None)[0]
    assert fitted @ fitted < 0.6 * (held @ held)
    left = left_out(L, held, part)
    assert left @ left > 0.9 * (held @ held)
    L = hats(nodes, lambda force: force, at := rng.uniform(0.0, 1.0, 1800))
    wave = np.sin(20.0 * at) + rng.normal(0.0, 0.1, 1800)
    left = left_out(L, wave, part)
    assert left @ left < 0.2 * (wave @ wave)
    nowhere = left_out(hats(nodes + 7.0, lambda force: force, rest)[:, 1:], wave, part)
    assert nowhere == pytest.approx(wave)


def test_a_second_term_has_parameters_of_its_own():
    """Of a force within an interval, too, which has two widths."""
    term = 'a*min(max(w0 - abs(X - x0), 0)/w2, 1)'
    assert 'a*tanh((X - x0)/w0) + b*min(max(w1 - abs(X - x1), 0)/w3, 1)' in set(
        sums('a*tanh((X - x0)/w0)', is_position=True)
    )
    assert all(' + b*' in text for text in sums(term, is_position=True))


def test_texts_are_told_apart():
    """None comes twice from its grammar, and each can be read."""
    for texts in (of_position(), of_velocity(is_own=True), of_velocity(is_own=False)):
        found = list(texts)
        assert len(found) < 500
        for text in found:
            read_formula(text.replace('X', 'q[X]'), is_law=True)
