"""One structure of laws for a machine and its simulation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sgp_ros.diagnosis import common_structure
from sgp_ros.diagnosis.common_structure import Side, common_models
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import first_scale
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place

NUMBERS = {
    'asymmetric_coulomb': {'real': [13.0, 35.0], 'sim': [55.0, -7.5]},
    'coulomb_friction': {'real': [24.0], 'sim': [24.0]},
    'constant_load': {'real': [11.0], 'sim': [-31.0]},
    'viscous_friction': {'real': [60.0], 'sim': [60.0]},
    'hysteresis': {'real': [24.0], 'sim': [24.0]},
    'stribeck_friction': {'real': [0.34, 0.75], 'sim': [0.34, 0.32]},
}
"""Numbers that a fit of each law finds: bodies hold a load up that the simulation has not."""


def _at(name, shape=()):
    return EffectAt(EFFECTS[name], Place(0), np.array(shape))


def _side(which, named, share=0.1, price=0.0):
    """A recording on which every structure is worth the less the more laws it has."""
    motion = SimpleNamespace(stated_number=lambda _number, _joint: 0.0)

    def fitted(effects, *, is_free):
        assert is_free
        laws = tuple(
            EffectAt(s.effect, s.place, s.shape, np.array(NUMBERS[s.name][which])) for s in effects
        )
        frame = SimpleNamespace(equations=SimpleNamespace(motion=motion))
        return SimpleNamespace(
            effects=laws, shares=(share,) * len(laws), frame=frame, law_price=price * len(laws)
        )

    scale = SimpleNamespace(worth=lambda m: -len(m.effects))
    return SimpleNamespace(named=named, fitted=fitted, scale=scale)


def _names(models):
    return [{s.name for s in m.effects} for m in models]


@pytest.mark.parametrize(('share', 'is_replaced'), [(0.1, True), (0.001, False)])
def test_a_law_that_one_side_cannot_have_gives_way_to_everyday_laws(share, is_replaced):
    """Friction that drives one way is a constant load beside plain friction, if it counts."""
    named = (_at('asymmetric_coulomb'),)
    models = common_models(_side('real', named), _side('sim', named, share), is_free=True)
    everyday = {'coulomb_friction', 'viscous_friction', 'constant_load'}
    assert _names(models) == [everyday if is_replaced else {'asymmetric_coulomb'}] * 2


def test_a_law_that_one_side_hardly_has_stays():
    """A static friction that is no more than that of sliding is none, and nothing impossible."""
    named = (_at('stribeck_friction', [0.4]),)
    models = common_models(_side('real', named), _side('sim', named), is_free=True)
    assert _names(models) == [{'stribeck_friction'}] * 2


def test_one_law_that_each_side_names_otherwise_is_there_once():
    """Dry friction that falls with the speed includes dry friction that does not."""
    real = _side('real', (_at('coulomb_friction'), _at('viscous_friction')), 0.001)
    sim = _side('sim', (_at('stribeck_friction', [0.4]), _at('constant_load')), 0.001)

    def worth(model):
        names = {s.name.removesuffix('_friction') for s in model.effects}
        kinds = {'coulomb', 'stribeck'} & names, {'viscous'} & names, {'constant_load'} & names
        return 10.0 * sum(map(bool, kinds)) - len(names)

    real.scale = sim.scale = SimpleNamespace(worth=worth)
    ours, theirs = _names(common_models(real, sim, is_free=True))
    assert ours == theirs
    assert {'viscous_friction', 'constant_load'} < ours
    assert len(ours) == 3


@pytest.mark.parametrize(('price', 'is_kept'), [(10.0, True), (0.0, False)])
def test_what_a_law_of_the_machine_alone_costs_is_paid_once(price, is_kept):
    """Worth 9 nats there and -10 in the simulation, where it is zero and costs its price."""
    real, sim = (_side(x, (_at('coulomb_friction'),), 0.001, price) for x in ('real', 'sim'))
    real.named = (*real.named, _at('viscous_friction'))
    for side, gained in ((real, 9.0), (sim, -10.0)):
        side.scale = SimpleNamespace(
            worth=lambda m, x=gained: x * any(s.name == 'viscous_friction' for s in m.effects)
        )
    found = _names(common_models(real, sim, is_free=True))
    assert found == [{'coulomb_friction', *['viscous_friction'] * is_kept}] * 2


@pytest.mark.parametrize('best', ['hysteresis', 'coulomb_friction'])
def test_of_a_plain_law_and_one_that_stands_for_it_both_have_the_same(best):
    """Dry friction builds up on the machine, not in the simulation: it has one level on each."""
    real = _side('real', (_at('hysteresis', [0.01]),), 0.001)
    sim = _side('sim', (_at('coulomb_friction'),), 0.001)
    real.scale = sim.scale = SimpleNamespace(
        worth=lambda m: 5.0 * len(m.effects) + any(s.name == best for s in m.effects)
    )
    assert _names(common_models(real, sim, is_free=True)) == [{best}] * 2


def test_shapes_of_laws_that_only_the_other_side_names_stay(equations_for, viscous):
    """An end stop that the motion of a simulation does not reach has no place of its own there."""
    _, equations = equations_for(viscous)
    wave = EffectAt(EFFECTS['cogging'], Place(0), np.array([7.3]))
    named = (EffectAt(EFFECTS['viscous_friction'], Place(0)),)
    side = Side(equations, None, Columns(equations), named)
    kept = next(
        s for s in side.fitted((*named, wave), is_free=False).effects if s.name == 'cogging'
    )
    assert kept.shape == pytest.approx([7.3])
    free = fit(Columns(equations), (*named, wave), first_scale(equations), is_free=False,
               steps=common_structure._STEPS)  # fmt: skip
    moved = next(s for s in free.effects if s.name == 'cogging')
    assert moved.shape != pytest.approx([7.3], rel=1e-6)


def test_the_only_size_of_a_law_that_the_other_side_names_is_found(equations_for, viscous):
    """A base that leans is not level by its shape alone: a simulation stands as it is."""
    _, equations = equations_for(viscous)
    place = EFFECTS['gravity_tilt'].places(equations.motion)[0]
    leaning = EffectAt(EFFECTS['gravity_tilt'], place, np.array([0.0, 0.2]))
    named = (EffectAt(EFFECTS['viscous_friction'], Place(0)),)
    model = Side(equations, None, Columns(equations), named).fitted(
        (*named, leaning), is_free=False
    )
    found = next(s for s in model.effects if s.name == 'gravity_tilt')
    assert abs(found.shape[1]) < 0.01
