"""Laws of the filter that both sides of the equation of motion pass through."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.held_commands import CommandHistory
from sgp_ros.engine.intake import State
from sgp_ros.engine.weak_form import WeakForm, polynomial_smoother
from sgp_ros.engine.windows import WindowFilter
from sgp_ros.physics.formula import read_formula
from sgp_ros.physics.term import Coefficient, Joint, Term
from sgp_ros.robots.robot import Robot


def _times(seed, m):
    rng = np.random.default_rng(seed)
    return np.sort(rng.uniform(-1, 1, size=m) * 0.05 + np.linspace(-0.2, 0.2, m))


FORMS = [WeakForm.from_positions, WeakForm.from_velocities]


@given(st.integers(0, 10_000), st.integers(3, 15))
def test_averaging_has_unit_area(seed, m):
    """A constant passes unchanged, for any spacing of stamps."""
    for make in FORMS:
        form = make(_times(seed, m))
        assert form.averaging.sum() == pytest.approx(1.0, abs=1e-9)
        end = form.times[-1] - form.times[0]
        assert form.cumulative(np.array([0.0, end])) == pytest.approx([0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize('seed', range(5))
def test_acceleration_is_the_kernel_average_of_the_true_one(seed):
    """Weights on positions or velocities equal the integral of kappa times q'', by quadrature."""
    t = _times(seed, 9)
    omega = 25.0
    position, velocity = np.sin(omega * t), omega * np.cos(omega * t)
    for form, signal in (
        (WeakForm.from_positions(t), position),
        (WeakForm.from_velocities(t), velocity),
    ):
        total = 0.0
        for j in range(len(t) - 1):
            step = t[j + 1] - t[j]

            def weighted(s, j=j, step=step, form=form):
                share = (s - t[j]) / step
                kernel = form.left[j] * (1 - share) + form.right[j] * share
                return kernel * -(omega**2) * np.sin(omega * s)

            total += integrate.quad(weighted, t[j], t[j + 1])[0]
        assert form.weights @ signal == pytest.approx(total, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize('make', FORMS)
def test_a_switching_command_gives_exactly_its_share_of_acceleration(make):
    """For q'' = command, held and switching anywhere in the window, both sides are equal.

    This is the half-sample shift that costs a factor of 1000 when states and commands are paired
    by index.
    """
    rng = np.random.default_rng(0)
    t = _times(1, 11)
    stamps = np.sort(rng.integers(-200_000_000, 200_000_000, size=6))
    stamps[0] = -400_000_000
    levels = rng.normal(size=6)
    commands = CommandHistory()
    for stamp, level in zip(stamps, levels, strict=True):
        commands.add(int(stamp), np.array([level]))
    times_ns = np.round(t * 1e9).astype(int)
    t = times_ns * 1e-9

    def velocity_at(s):
        edges = np.minimum(np.append(stamps[1:], 10**12) * 1e-9, s) - np.minimum(stamps * 1e-9, s)
        return edges @ levels

    def position_at(s):
        edges = np.clip(s - stamps * 1e-9, 0, None) ** 2 / 2
        following = np.clip(s - np.append(stamps[1:], 10**12) * 1e-9, 0, None) ** 2 / 2
        return (edges - following) @ levels

    form = make(t)
    source = position_at if make == WeakForm.from_positions else velocity_at
    acceleration = form.weights @ np.array([source(s) for s in t])
    average = commands.average(int(times_ns[0]), int(times_ns[-1]), form.cumulative)
    assert acceleration == pytest.approx(average[0], abs=1e-9)


@given(st.integers(0, 10_000), st.integers(5, 12))
def test_smoother_reproduces_polynomials(seed, m):
    """Values and derivatives of a cubic are exact for degree 4 at any stamps."""
    t = _times(seed, m)
    values, slopes, curvatures = polynomial_smoother(t, 4)
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 5.0])
    np.testing.assert_allclose(values @ cubic(t), cubic(t), atol=1e-8)
    np.testing.assert_allclose(slopes @ cubic(t), cubic.deriv()(t), atol=1e-6)
    np.testing.assert_allclose(curvatures @ cubic(t), cubic.deriv(2)(t), atol=1e-3)


@given(st.integers(0, 10_000), st.integers(3, 15))
def test_three_nodes_average_a_quadratic_as_the_kernel_does(seed, m):
    """So M(q), which changes slowly within a window, is asked for at three samples."""
    for make in FORMS:
        form = make(_times(seed, m))
        nodes, shares = form.nodes()
        assert len(set(nodes)) == 3
        quadratic = np.polynomial.Polynomial([0.3, -1.0, 2.0])(form.times)
        assert shares @ quadratic[nodes] == pytest.approx(form.averaging @ quadratic, abs=1e-9)


@pytest.mark.parametrize('source', ['position', 'measured'])
def test_an_inertia_that_changes_within_the_window_leaves_no_error(source):
    """`effort = cos(q) a` holds for windows in which q, and so the inertia, goes far.

    With the inertia at the centre times the mean acceleration 3 % of the effort are left here.
    """
    column = read_formula('cos(q[hinge]) * ddq[hinge]').column(['hinge'])
    inertia = Term((Coefficient('J', 'kg m^2', 'hinge'),),
                   lambda motion: column(motion)[:, None, None], 'Newton')  # fmt: skip
    robot = Robot('hinge', (Joint('hinge'),), 'effort', (inertia,), ((),))
    config = EngineConfig(filter_window=0.2, filter_velocity=source)
    filtered, commands = WindowFilter(robot, config), CommandHistory()
    errors, efforts = [], []
    for stamp_ns in range(0, 2_000_000_000, 2_000_000):
        t = stamp_ns * 1e-9
        q, v, a = np.sin(6.0 * t), 6.0 * np.cos(6.0 * t), -36.0 * np.sin(6.0 * t)
        state = State(stamp_ns, *(np.array([x]) for x in (q, v, np.cos(q) * a)))
        for equation in filtered.push(state, commands):
            row = equation.regressor(equation.motion.acceleration[0])[0]
            efforts.append(equation.motion.effort[0, 0])
            errors.append(efforts[-1] - row[0])
    assert np.std(errors) < 1e-3 * np.std(efforts)


def test_kernel_is_a_bump():
    """At even spacing the kernel is positive and zero at both ends: a low-pass filter."""
    form = WeakForm.from_positions(np.linspace(-0.1, 0.1, 21))
    assert form.left.min() > -1e-12
    assert form.left[0] == 0.0
    assert form.right[-1] == 0.0


def test_commands_hold_until_the_next():
    """Age and average follow the zero-order hold; forgetting keeps the one in force."""
    history = CommandHistory()
    assert history.age_ns(5) is None
    history.add(10, np.array([1.0]))
    history.add(20, np.array([3.0]))
    history.add(20, np.array([4.0]))
    assert history.age_ns(9) is None
    assert history.age_ns(25) == 5
    history.forget_before(15)
    assert history.stamps_ns == [10, 20]
    history.forget_before(30)
    assert history.stamps_ns == [20]
    assert history.efforts[0] == 4.0
