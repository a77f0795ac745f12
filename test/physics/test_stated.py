"""Stated values of effects against what a diagnosis reports."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.drive import Drive
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.memory import BARE
from sgp_ros.physics.place import Place
from sgp_ros.rigid.tree import read_urdf
from sgp_ros.robots.observed_motion import ObservedMotion
from test.rigid.test_tree import ARM, FINGER

URDF = (
    (ARM % FINGER)
    .replace('link name="tool"', 'link name="tool0"')
    .replace('link="tool"', 'link="tool0"')
    .replace(
        '<link name="left"/>', '<link name="left"><inertial><mass value="0.1"/></inertial></link>'
    )
)


def _motion():
    tree = read_urdf(URDF)
    rng = np.random.default_rng(0)
    q, v, a, tau = rng.normal(size=(4, 40, tree.size))
    time = 0.01 * np.arange(40)
    drive = Drive(time, tau, ((0.0, 40),), 0.01)
    return ObservedMotion(tree, time, 0.01, q, v, a, tau, drive)


MOTION = _motion()
CASES = [
    (effect, place)
    for effect in EFFECTS.values()
    for place in {(p.kind, p.side): p for p in effect.places(MOTION)}.values()
]

_OTHER = {-1: 'base', -2: 'tool', -3: 'all'}


def _id(value):
    return value.name if hasattr(value, 'name') else f'{value.kind}{value.side or ""}'


def _values(effect, kind, seed):
    rng = np.random.default_rng(seed)
    values = {q.name: float(rng.uniform(0.1, 0.9)) for q in effect.stated_quantities(kind)}
    if effect.name == 'position_friction':
        values['hi'] += 1.0
    return values


@pytest.mark.parametrize(('effect', 'place'), CASES, ids=_id)
def test_what_was_stated_is_reported(effect, place):
    """Values to shape and coefficients and back by the report of the diagnosis, all effects."""
    for seed in range(3):
        values = _values(effect, place.kind, seed)
        shape, c = effect.model(values, place.kind)
        report = EffectAt(effect, place, shape, c).report(MOTION)
        numbers = {k: v for k, v in report.items() if not isinstance(v, str)}
        hidden = {'motor_inertia'} if effect.name == 'backlash' else set()
        assert {k: numbers[k] for k in values if k not in hidden} == pytest.approx(
            {k: x for k, x in values.items() if k not in hidden}, rel=1e-12
        )


@pytest.mark.parametrize(('effect', 'place'), CASES, ids=_id)
def test_what_was_reported_is_stated_at_the_same_place(effect, place):
    """Shape, coefficients, joint, kind, source and side; only a backlash hides a part.

    A motor that the nominal robot lacks is stated with the rotor, which then is part of it.
    """
    rng = np.random.default_rng(1)
    starts = effect.starts(MOTION, place)
    shape = starts[0] if len(starts) else np.array([-0.5, 0.5])
    if effect.small is not None:
        shape = effect.small.shape(shape, np.array([0.02, -0.01]))
    c = np.ones(1)
    if not effect.is_given:
        columns = effect.columns(MOTION, place, shape)
        c = rng.uniform(0.2, 1.0, size=columns.shape[-1])
        assert columns.shape[-1] == len(effect.coefficient_quantities(place.kind))
    report = EffectAt(effect, place, shape, c).report(MOTION)
    numbers = {k: v for k, v in report.items() if not isinstance(v, str)}
    again, d = effect.model(numbers, place.kind)
    hidden = np.isnan(again)
    assert hidden.any() == (effect.name == 'backlash')
    np.testing.assert_allclose(again[~hidden], shape[~hidden], rtol=1e-12)
    np.testing.assert_allclose(d, c, rtol=1e-12)
    joint = _OTHER.get(place.joint) or MOTION.tree.joint_names[place.joint]
    words = effect.stated_words(place, MOTION.tree)
    assert words.items() >= {k: v for k, v in report.items() if isinstance(v, str)}.items()
    own = 'motor' if effect.kinds else ''
    stated = replace(place, kind=own) if place.kind == BARE else place
    assert EffectAt.stated(effect, joint, numbers | words, MOTION.tree).place == stated


@pytest.mark.parametrize('effect', EFFECTS.values(), ids=_id)
def test_a_joint_may_be_called_like_a_place_of_another_law(effect):
    """A law of a joint called `base` is on that joint, one of the base is on the base."""
    names = 'base', 'tool', *MOTION.tree.joint_names[2:]
    tree = replace(MOTION.tree, joint_names=names)
    for place in effect.places(replace(MOTION, tree=tree)):
        joint = names[place.joint] if place.joint >= 0 else _OTHER[place.joint]
        words = effect.stated_words(place, tree)
        values = _values(effect, place.kind, 0)
        at = EffectAt.stated(effect, joint, values | words, tree).place.joint
        assert at == place.joint
        assert (EffectAt.wanted(effect, joint, values).place.joint < -3) == (place.joint >= 0)


@pytest.mark.parametrize('effect', [e for e in EFFECTS.values() if e.edge], ids=_id)
@pytest.mark.parametrize('side', [-1, 1])
def test_an_unstated_side_is_the_nearer_end_of_the_range(effect, side):
    tree = MOTION.tree
    j = next(j for j in range(tree.size) if np.isfinite(tree.upper[j]))
    joint = tree.joint_names[j]
    edge = 0.5 * (tree.upper[j] + tree.lower[j]) + side * 0.4 * (tree.upper[j] - tree.lower[j])
    assert Place.of(effect.site, effect.edge, joint, {}, {effect.edge: edge}, tree) == Place(
        j, side=side
    )


def test_the_spread_of_coefficients_is_that_of_the_values():
    """First order against samples; a product and a wave."""
    rng = np.random.default_rng(0)
    for name, values in (
        ('spring', {'stiffness': 2.9, 'rest': 0.4}),
        ('cogging', {'amplitude': 0.5, 'periods': 7.0, 'phase': 0.7}),
    ):
        std = dict.fromkeys(values, 0.01)
        drawn = np.array(
            [
                EFFECTS[name].model({k: x + 0.01 * rng.normal() for k, x in values.items()})[1]
                for _ in range(4000)
            ]
        )
        found = EFFECTS[name].coefficient_std(values, std)
        np.testing.assert_allclose(found, drawn.std(axis=0), rtol=0.05)  # 4.5 / sqrt(2 * 4000)


def test_a_coefficient_is_unknown_where_a_value_that_matters_is():
    std = EFFECTS['spring'].coefficient_std({'stiffness': 2.0, 'rest': 0.5}, {'stiffness': 0.1})
    assert std[0] == pytest.approx(0.1)
    assert std[1] == math.inf


def test_an_eccentric_encoder_is_as_uncertain_as_its_amplitude():
    """Its one coefficient scales what the stated numbers say."""
    encoder = EFFECTS['encoder_eccentricity']
    numbers = {'amplitude': 0.05, 'periods': 3.0, 'phase': 0.4}
    shape, c = encoder.model(numbers)
    assert c == pytest.approx([1.0])
    assert shape == pytest.approx([3.0, 0.05 * np.cos(0.4), 0.05 * np.sin(0.4)])
    std = encoder.coefficient_std(numbers, {'amplitude': 0.005})
    assert std == pytest.approx([0.1])
    assert np.isinf(encoder.coefficient_std(numbers, {})).all()
