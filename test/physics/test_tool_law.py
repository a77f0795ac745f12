"""Laws of a force on the tool along a path."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.parts import LawParameter
from sgp_ros.physics.place import Place
from sgp_ros.physics.tool_law import ANCHOR, ATTACHED, DISTANCE, PATHS, ToolLaw, tool_point
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion
from sgp_ros.robots.stated_effects import read_effects
from test.rigid.random_urdf import random_urdf
from test.simulation.trees import spatial_arm

URDF = spatial_arm()
TREE = read_urdf(URDF)
POINTS = dict(zip((*ATTACHED, *ANCHOR), (0.1, -0.05, 0.2, 0.7, 0.3, 1.1), strict=True))
TEXTS = {
    'x': 'a + b*s', 'y': '-b*s**2/r', 'z': 'b*max(s - r, 0)', DISTANCE: 'a + b*s',
    'motion': '-c*ds',
}  # fmt: skip
UNITS = {'a': 'N', 'b': 'N/m', 'c': 'N s/m', 'r': 'm'}
VALUES = {'a': 3.0, 'b': -2.0, 'c': 0.7, 'r': 0.4}


def seen(n=40, seed=0, tree=TREE):
    """Return a motion of random states."""
    q, v = np.random.default_rng(seed).normal(size=(2, n, tree.size))
    still = np.zeros_like(q)
    return ObservedMotion(tree, 0.01 * np.arange(n), 0.01, q, v, still, still, None)


def stated(path, **change):
    """Return a law as a robot YAML states it, and what is wrong with it."""
    text = change.pop('text', TEXTS.get(path, 'a'))
    names = sorted(read_formula(text, is_law=True).parameters - {'s', 'ds'})
    entry = {n: {'value': VALUES[n], 'unit': UNITS[n]} for n in names}
    points = POINTS if path == DISTANCE else {n: POINTS[n] for n in ATTACHED}
    entry |= {n: {'value': x, 'unit': 'm'} for n, x in points.items()}
    entry = {n: x for n, x in (entry | change).items() if x is not None}
    problems = []
    law = {'joint': 'tool', 'formula': f'F_{path}[tool] = {text}', 'parameters': entry}
    found = read_effects([{'law': law}], TREE, problems)
    return found, problems


@pytest.mark.parametrize('path', PATHS)
def test_a_force_does_the_work_of_its_path(path):
    """The power of the joints is force times rate, whatever the path."""
    (law,), problems = stated(path)
    assert problems == []
    motion, effect = seen(), law.effect
    tau = law.force(motion)
    way, rate, _ = effect._way(motion, POINTS)
    F = effect.law.compiled(
        lambda n: lambda _: {'s': way, 'ds': rate, **VALUES}[n], lambda *_: None
    )(None)
    np.testing.assert_allclose((tau * motion.velocity).sum(axis=1), F * rate, atol=1e-12)
    assert law.effect.formula == f'F_{path}[tool] = {TEXTS[path]}'


def test_a_pull_is_that_of_a_constant_force_far_away():
    """Towards a point a kilometre off, all lever arms are those of `tip_force`."""
    far = {
        n: {'value': 1e6 * x, 'unit': 'm'} for n, x in zip(ANCHOR, (0.6, 0.0, 0.8), strict=True)
    }
    at = {n: {'value': x, 'unit': 'm'} for n, x in zip(ATTACHED, tool_point(TREE), strict=True)}
    (law,), _ = stated(DISTANCE, text='a', **far, **at)
    constant = EffectAt.stated(
        read_effects([{'effect': 'tip_force', 'joint': 'tool', 'parameters': {
            n: {'value': x, 'unit': 'N'} for n, x in (('fx', -1.8), ('fy', 0.0), ('fz', -2.4))}}],
            TREE, [])[0].effect, 'tool', {'fx': -1.8, 'fy': 0.0, 'fz': -2.4}, TREE)  # fmt: skip
    np.testing.assert_allclose(law.force(seen()), constant.force(seen()), atol=1e-5)


def test_a_law_without_a_point_acts_on_the_tool():
    (law,), problems = stated('z', **dict.fromkeys(ATTACHED))
    assert problems == []
    np.testing.assert_allclose([law.parameters[n] for n in ATTACHED], tool_point(TREE))


@pytest.mark.parametrize(
    ('path', 'change', 'why'),
    [
        ('height', {}, "the path 'height'"),
        ('x', {'text': 'b*s*t'}, 'one of s, x, y, z, ds alone'),
        ('x', {'text': 'b*lag(s, r)'}, 'one of s, x, y, z, ds alone'),
        ('x', {'text': 'b*q[j1]'}, 'one of s, x, y, z, ds alone'),
        ('x', {'text': 'a*s'}, 'has the unit kg m2/s2, not N'),
        (DISTANCE, {'px': None}, 'px is None'),
        ('z', {'px': {'value': 1.0, 'unit': 'm'}}, "'px' is not in the formula"),
    ],
)
def test_what_is_wrong_with_a_law_of_the_tool_is_said(path, change, why):
    found, problems = stated(path, **change)
    assert found == ()
    assert any(why in p for p in problems), problems


def test_a_robot_of_several_ends_has_no_tool():
    tree = read_urdf(random_urdf(8, 6, fixed=0))
    assert tree.tool_body == -1
    problems = []
    law = {'joint': 'tool', 'formula': 'F_z[tool] = a',
           'parameters': {'a': {'value': 1.0, 'unit': 'N'}}}  # fmt: skip
    assert read_effects([{'law': law}], tree, problems) == ()
    assert 'several links are outermost' in problems[0]
    assert seen(tree=tree).tool is None
    assert _law('z').places(seen(tree=tree)) == []


def _law(path, *, is_known=False):
    points = [LawParameter(n, 'm', -9.0, start=0.3, high=9.0, is_known=is_known)
              for n in ToolLaw.point_names(path)]  # fmt: skip
    formula = read_formula('a + b*s', is_law=True)
    own = [LawParameter('a', 'N'), LawParameter('b', 'N/m')]
    return ToolLaw(formula, path, [*own, *points], is_open=True)


def test_a_search_starts_with_points_of_the_world_all_around():
    """At all distances between the motion and far away; a known point is not looked for."""
    law, motion, place = _law(DISTANCE), seen(), Place(-2)
    starts = law.starts(motion, place)
    assert law.shape_names() == (*ATTACHED, *ANCHOR)
    assert (starts[:, :3] == 0.3).all()
    middle = motion.tool.points(tool_point(TREE)).mean(axis=0)
    away = starts[1:, 3:] - middle
    assert len(np.unique(np.linalg.norm(away, axis=1).round(9))) == 4
    np.testing.assert_allclose(away.mean(axis=0), 0.0, atol=1e-9)
    assert _law('x', is_known=True).starts(motion, place).shape == (1, 0)


def test_a_step_to_a_far_point_is_larger():
    """As the direction changes with its angle; one never exceeds the range that is searched."""
    law, motion = _law(DISTANCE), seen()
    near, far = (law.scales(motion, Place(-2), np.array([0.3, 0.3, 0.3, d, d, d]))
                 for d in (0.5, 5.0))  # fmt: skip
    assert (near[3:] < 0.5 * far[3:]).all()
    assert (far <= 18.0).all()
    np.testing.assert_array_equal(near[:3], far[:3])


@pytest.mark.parametrize(
    ('path', 'said'),
    [
        (DISTANCE, 'its distance from the point (0.7, 0.3, 1.1) m'), ('z', 'its z in the axes'),
        ('motion', 'ds is its speed'),
    ],
)  # fmt: skip
def test_a_law_of_the_tool_is_put_in_words(path, said):
    """With the point it acts on and the force at both ends of what was seen."""
    (law,), _ = stated(path)
    motion = seen()
    way, rate, _ = law.effect._way(motion, POINTS)
    text = law.effect.sentence(law, motion)
    assert said in text
    assert 'the point (0.1, -0.05, 0.2) m of the link' in text
    F = {DISTANCE: 3.0 - 2.0 * way, 'z': -2.0 * np.maximum(way - 0.4, 0.0), 'motion': -0.7 * rate}
    ends = [F[path][way.argmin()], F[path][way.argmax()]]
    assert all(f'{x + 0.0:.3g} N at' in text for x in ends)
