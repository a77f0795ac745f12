"""Laws of the discrepancy from the nominal robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.bodies import SPREAD, body_directions, load_precision, shrinkage
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.grid import INSTANT_SPREAD
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.explain import regression
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.place import Place
from test.diagnosis.worlds import CHAINS, World, events_of, robot_of


def start(equations):
    """Return the scale a fit begins with."""
    return np.sqrt((equations.d**2).mean(axis=0) + floors(equations))


@pytest.mark.parametrize('k', [1, 2])
def test_the_discrepancy_of_the_true_model_is_zero(equations_for, perfect, k):
    """A hundred-thousandth of the mean squared effort is what encoder and filters leave."""
    _, equations = equations_for(perfect[k])
    assert np.all((equations.d**2).mean(axis=0) < 1e-5 * equations.power)
    np.testing.assert_allclose(equations.power, (perfect[k].command ** 2).mean(axis=0), rtol=0.05)


@pytest.mark.parametrize('k', [1, 2])
def test_a_wrong_mass_appears_in_w_with_its_value(equations_for, heavy, k):
    """First moment and inertia about the axis are what the last link shows; 30 % more of each."""
    _, equations = equations_for(heavy[k])
    assert np.all((equations.d**2).mean(axis=0) > 1e-3 * equations.power)
    model = fit(Columns(equations), (), start(equations))
    assert np.all(model.mean_square < 2e-5 * equations.power)
    change = (model.w @ equations.directions).reshape(k, 10)[k - 1]
    link = CHAINS[k][-1]
    about = link.inertia + link.mass * link.centre**2
    # z of the first moment, iyy about the origin of the link
    np.testing.assert_allclose(change[3], -0.3 * link.mass * link.centre, rtol=0.02)
    np.testing.assert_allclose(change[6], 0.3 * about, rtol=0.03)


def test_directions_are_one_deviation_of_mass_centre_and_inertia(robots):
    """A step along the mass scales the body; along the centre keeps its mass and size."""
    _, tree = robots[2]
    D = body_directions(tree).reshape(2, 10, 2, 10)
    for body in range(2):
        assert not D[body][:, 1 - body].any()
        own = D[body][:, body]
        np.testing.assert_allclose(own[0], 0.25 * tree.parameters[body])
        assert not own[1:, 0].any()
        moved = tree.parameters[body] + own[3]
        centre = moved[1:4] / moved[0]
        before = tree.parameters[body, 1:4] / moved[0]
        assert centre[2] > before[2]
        about = moved[6] - moved[0] * centre[2] ** 2
        size = tree.parameters[body, 6] - moved[0] * before[2] ** 2
        # the same size, but for the square of the step
        step = centre[2] - before[2]
        assert about + moved[0] * step**2 == pytest.approx(size, rel=1e-9)
        assert np.linalg.matrix_rank(own) == 10


@pytest.mark.parametrize('size', [1.4, 0.9, 0.1, -0.2])
def test_a_body_that_is_nearly_gone_costs_as_a_logarithm(perfect, equations_for, size):
    """The normal prior alone has bodies of no size at four deviations; more costs as before."""
    tree = equations_for(perfect[2])[1].motion.tree
    w = np.zeros(10 * len(tree.parameters))
    w[10] = (size - 1.0) / SPREAD  # of the second body
    total = 0.5 * w @ w + shrinkage(body_directions(tree), tree, w)
    least = 0.5 * (np.log(np.clip(size, 1e-3, None)) / SPREAD) ** 2
    assert total == pytest.approx(least if 0.0 < size < 1.0 else max(total, 0.5 * w @ w))
    assert (total > 1.01 * 0.5 * w @ w) == (size < 1.0)
    assert total > 40.0 or size > 0.5


def test_a_model_pays_for_bodies_that_are_nearly_gone(equations_for, perfect):
    _, equations = equations_for(perfect[2])
    model = fit(Columns(equations), (), start(equations))
    w = np.zeros(equations.size)
    w[equations.instants + 10] = -0.9 / SPREAD
    assert replace(model, w=w).strain > 2.0 * 0.5 * w @ w


def test_a_load_widens_the_last_body_alone(robots):
    """By a quarter of all that moves, beyond the link; a link without inertia carries none."""
    _, tree = robots[2]
    narrow = body_directions(tree)
    wide = np.linalg.inv(load_precision(narrow, tree))
    np.testing.assert_allclose(wide[:10], np.eye(20)[:10])
    covariances = np.eye(10), wide[10:, 10:]
    both = [np.sqrt(np.diag(narrow[10:].T @ x @ narrow[10:]))[10:] for x in covariances]
    mass = 0.25 * tree.parameters[:, 0].sum()
    assert both[1][0] == pytest.approx(np.hypot(both[0][0], mass))
    assert (both[1] > both[0]).all()
    hollow = replace(tree, parameters=np.zeros_like(tree.parameters))
    np.testing.assert_array_equal(load_precision(body_directions(hollow), hollow), np.eye(20))


def test_a_load_is_as_wide_beside_bodies_that_are_nearly_right(robots):
    _, tree = robots[2]
    directions = body_directions(tree)
    np.testing.assert_allclose(body_directions(tree, accuracy=0.2), 0.2 * directions)
    np.testing.assert_allclose(body_directions(tree, (1,), 0.2)[10:], 4.0 * directions[10:])
    far, near = (np.linalg.inv(load_precision(directions, tree, a)) for a in (1.0, 0.2))
    np.testing.assert_allclose(near[:10, :10], 0.04 * np.eye(10))
    np.testing.assert_allclose(far[10:, 10:] - near[10:, 10:], 0.96 * np.eye(10), atol=1e-9)


def test_rows_in_which_dry_friction_holds_ask_nothing(equations_for, dry):
    """There the target is zero and no effect, except inertia, may push."""
    _, equations = equations_for(dry)
    share = equations.rests[:, 0].mean()
    assert 0.02 < share < 0.9
    held = equations.with_dry_friction(frozenset([0]))
    assert equations.with_dry_friction(frozenset()) is equations
    low = equations.filter
    half = len(low.taps) // 2
    rests = equations.rests[:, 0]
    inside = np.array([rests[i - half : i + half + 1].all() for i in low.rows])
    assert inside.any()
    assert held.d[inside].std() < 0.1 * equations.d[inside].std()
    column = np.ones((len(equations.motion.time), 1))
    assert np.abs(held.compact(column, 0, is_inertial=False)[inside]).max() < 1e-12
    assert np.abs(held.compact(column, 0, is_inertial=True)[inside]).min() > 0.99


@pytest.mark.parametrize('periods', [-0.3, -1.0])
def test_efforts_of_another_instant_are_no_mismatch(equations_for, perfect, periods):
    """Their instant is estimated, with its sign, where bodies are those of the file.

    A command that is held from its stamp on acts half a period later on average.
    """
    world = perfect[2]
    step = float(np.median(np.diff(world.time)))
    read = [np.interp(world.time + periods * step, world.time, tau) for tau in world.command.T]
    _, now = equations_for(world, effort=world.command, commands=False)
    _, then = equations_for(world, effort=np.column_stack(read), commands=False)
    fitted = [fit(Columns(e), (), start(e), is_free=False) for e in (now, then)]
    assert then.instants == 2
    assert all(np.all(m.mean_square < 2e-5 * now.power) for m in fitted)
    apart = fitted[1].w[:2] - fitted[0].w[:2]
    np.testing.assert_allclose(apart * INSTANT_SPREAD, -periods, rtol=0.05)
    assert not fitted[1].w[2:].any()
    np.testing.assert_array_equal(then.force_of_bodies(fitted[1].w), 0.0)


def test_the_instants_of_commands_are_known(equations_for, perfect):
    """They have a stamp of their own, and a delay is an effect."""
    assert equations_for(perfect[2])[1].instants == 0


def test_an_effort_that_friction_takes_up_has_no_instant(equations_for, dry):
    """In rows where a joint is held, its measured effort may be any."""
    _, equations = equations_for(dry, effort=dry.command, commands=False)
    held = equations.with_dry_friction(frozenset([0]))
    half, rests = len(held.filter.taps) // 2, equations.rests[:, 0]
    inside = np.array([rests[i - half : i + half + 1].all() for i in held.filter.rows])
    assert np.abs(equations.bases[0][inside, 0]).max() > 1e-6
    assert np.abs(held.bases[0][inside, 0]).max() < 1e-12


def test_a_robot_that_never_rests_has_no_held_rows(equations_for, perfect):
    """Reversals are no rest: asking for dry friction changes nothing."""
    _, equations = equations_for(perfect[2])
    assert equations.with_dry_friction(frozenset([0, 1])) is equations


def test_more_inertia_costs_what_its_determinant_says(equations_for, perfect):
    """Log of the ratio of inertias of one link; minus infinity where none is left."""
    _, equations = equations_for(perfect[1])
    link = CHAINS[1][0]
    inertia = link.inertia + link.mass * link.centre**2
    w, one = np.zeros(10), np.ones(1)
    assert equations.inertia(w, np.zeros((1, 1)), one) == pytest.approx(0.0, abs=1e-12)
    assert equations.inertia(w, np.full((1, 1), inertia), one) == pytest.approx(np.log(2.0))
    assert equations.inertia(w, np.full((1, 1), -2.0 * inertia), one) == -np.inf
    w[0] = 1.0
    assert equations.inertia(w, np.zeros((1, 1)), one) == pytest.approx(np.log(1.25))


def test_floors_are_those_of_the_inertia_that_the_efforts_show(equations_for, perfect, tmp_path):
    """A rotor of fifty times the link: what a perfect model leaves is relative to both."""
    (link,) = CHAINS[1]
    light = replace(link, mass=link.mass / 50.0, inertia=link.inertia / 50.0)
    robot, tree = robot_of(tmp_path, (light,))
    raw = collect(events_of(perfect[1]), robot)
    geared = make_equations(raw, tree, choose_bandwidth(raw, tree))
    assert geared.carried == pytest.approx(np.log(50.0), abs=0.1)
    np.testing.assert_allclose(floors(geared, geared.carried), floors(geared))
    assert floors(geared, geared.carried)[0] < 1e-4 * geared.power[0]
    _, plain = equations_for(perfect[1])
    assert plain.carried == pytest.approx(0.0, abs=0.02)


def _beside_a_still_joint(world):
    def wide(x):
        return np.column_stack([x, np.zeros(len(x))])

    return World(world.time, *(wide(getattr(world, name)) for name in (
        'position', 'velocity', 'acceleration', 'command',
    )))  # fmt: skip


def test_a_joint_that_does_not_move_is_asked_nothing(robots, viscous):
    """No matter what holds it, no candidate has a place there."""
    robot, tree = robots[2]
    world = _beside_a_still_joint(viscous)
    raw = collect(events_of(world), robot)
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    assert not equations.d[:, 1].any()
    assert not equations.base[:, 1].any()
    assert np.isfinite(equations.power).all()
    assert equations.motion.moving_joints == (0,)


def test_columns_know_whom_they_were_made_for(equations_for, viscous, monkeypatch):
    """Other bodies, other columns; the same question, the same array."""
    _, equations = equations_for(viscous)
    columns = Columns(equations)
    tilt = EffectAt(EFFECTS['gravity_tilt'], Place(-1), np.array([0.0, 0.1]))
    w = np.zeros(10)
    nominal = columns.of(tilt, equations, w)
    assert columns.of(tilt, equations, w) is nominal
    w[0] = 1.0
    np.testing.assert_allclose(columns.of(tilt, equations, w), 1.25 * nominal, atol=1e-12)
    rub = EffectAt(EFFECTS['viscous_friction'], Place(0), np.zeros(0))
    plain = columns.of(rub, equations)
    np.testing.assert_array_equal(columns.of(rub, equations, w), plain)
    motion = equations.motion
    assert columns.local(rub, equations, motion) is columns.local(rub, equations, motion)
    monkeypatch.setattr(regression, 'MOST_HELD', 100 * len(equations.d))
    first = columns.local(rub, equations, motion)
    for i in range(450):
        columns.of(replace(tilt, shape=np.array([0.0, 0.001 * i])), equations, w)
        assert columns.local(rub, equations, motion) is first  # asked for again and again
    assert len(columns._known) <= 101
    assert sum(x.x.size for x in columns._known.values()) <= 101 * len(equations.d)
