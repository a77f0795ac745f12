"""Laws of the zero-phase filter and of the derivatives behind it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgp_ros.batch.zero_phase import (
    REACH,
    ZeroPhase,
    first_derivative,
    second_derivative,
    sharpened,
)
from sgp_ros.errors import ConfigError

RATE = 100.0


def _inner(x, trim):
    return x[trim : len(x) - trim]


@given(st.floats(0.2, 0.95), st.floats(0.0, 6.0))
def test_a_sinusoid_keeps_its_phase_and_takes_the_stated_gain(share, phase):
    """Away from the ends the filter multiplies by its gain; a shift would show at once."""
    zero_phase = ZeroPhase(RATE, 5.0)
    frequency = share * 8.0
    t = np.arange(1000) / RATE
    x = np.sin(2 * np.pi * frequency * t + phase)
    expected = zero_phase.gain(np.array(frequency)) * x
    trim = zero_phase.trim
    assert _inner(zero_phase.smooth(x), trim) == pytest.approx(_inner(expected, trim), abs=2e-3)


def test_states_are_derivatives_of_one_filtered_signal():
    """Velocity and acceleration of a sinusoid carry the gain of the position, nothing else."""
    zero_phase = ZeroPhase(RATE, 10.0)
    omega = 2 * np.pi * 4.0
    t = np.arange(800)[:, None] / RATE
    q, v, a = zero_phase.states(np.sin(omega * t))
    gain, trim = zero_phase.gain(np.array(4.0)), 3 * zero_phase.trim
    for found, exact in ((q, np.sin(omega * t)), (v, omega * np.cos(omega * t)),
                         (a, -(omega**2) * np.sin(omega * t))):  # fmt: skip
        scale = np.abs(exact).max()
        assert _inner(found, trim) == pytest.approx(_inner(gain * exact, trim), abs=1e-5 * scale)
    q2, v2, a2 = zero_phase.states(np.sin(omega * t), omega * np.cos(omega * t))
    assert _inner(q2, trim) == pytest.approx(_inner(q, trim))
    assert _inner(v2, trim) == pytest.approx(_inner(v, trim), abs=1e-5 * omega)
    assert _inner(a2, trim) == pytest.approx(_inner(a, trim), abs=1e-5 * omega**2)


def test_beyond_the_trim_the_ends_are_forgotten():
    """Two signals that differ at the first sample alone agree there to a thousandth."""
    zero_phase = ZeroPhase(RATE, 3.0)
    x = np.zeros(600)
    y = x.copy()
    y[0] = 1.0
    difference = np.abs(zero_phase.smooth(y) - zero_phase.smooth(x))
    assert difference[zero_phase.trim : -zero_phase.trim].max() < 1e-3
    assert difference.max() > 1e-2


@given(st.integers(0, 1000), st.integers(0, 7))
def test_differences_are_exact_for_polynomials_of_their_order(seed, degree):
    """Eighth order: every polynomial up to degree seven is differentiated without error."""
    coefficients = np.random.default_rng(seed).uniform(-1, 1, degree + 1)
    polynomial = np.polynomial.Polynomial(coefficients)
    t = np.linspace(-1, 1, 41)
    rate = 20.0
    x = polynomial(t)
    assert _inner(first_derivative(x, rate), REACH) == pytest.approx(
        _inner(polynomial.deriv(1)(t), REACH), abs=1e-9
    )
    assert _inner(second_derivative(x, rate), REACH) == pytest.approx(
        _inner(polynomial.deriv(2)(t), REACH), abs=1e-8
    )


def test_the_second_derivative_is_the_sharpened_second_difference():
    """So a force averaged with the hat and an acceleration pass the same filter."""
    x = np.random.default_rng(0).normal(size=50)
    difference = np.zeros(50)
    difference[1:-1] = np.diff(x, 2)
    trim = REACH + 1
    assert _inner(sharpened(difference), trim) == pytest.approx(
        _inner(second_derivative(x, 1.0), trim), rel=1e-12, abs=1e-12
    )


@pytest.mark.parametrize('cutoff', [0.0, 50.0, -1.0])
def test_an_impossible_cutoff_is_refused(cutoff):
    """The error names cut-off and rate."""
    with pytest.raises(ConfigError, match='at 100 Hz'):
        ZeroPhase(RATE, cutoff)
