"""Laws of cutting recordings and scoring roll-outs."""

from __future__ import annotations

import numpy as np
import pytest

from sgp_ros.batch.rollout import cut_windows, joined, roll_out
from sgp_ros.batch.rollout_scores import rollout_scores, score_windows
from sgp_ros.errors import RecordingError
from sgp_ros.robots.registry import load_robot

ROBOT = load_robot('simple_pendulum')
W = np.array([0.15, 3.0, 0.05, 0.1, 0.02])
STEP = 0.01


def _recording(n=300, seed=0):
    """A recording that the model itself made, with an effort constant in each step."""
    level = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.2, size=(1, n, 1)), axis=1)
    q, v = roll_out(ROBOT, W, np.array([[0.5]]), np.zeros((1, 1)), level, STEP)
    return STEP * np.arange(n + 1), q[0], v[0], level[0]


def _smooth(n=300):
    time = STEP * np.arange(n + 1)
    x = np.stack([np.sin(time), np.cos(2.0 * time)], axis=1)
    return time, x, 2.0 * x, 3.0 * x


def test_windows_of_a_uniform_recording_are_its_samples():
    """Starts every stride, all steps inside, no interpolation."""
    time, q, v, effort = _smooth()
    w = cut_windows(time, q, v, effort, 0.5, 0.2)
    assert w.q.shape == (13, 51, 2)
    assert w.effort.shape == (13, 50, 2)
    for i, start in enumerate(range(0, 251, 20)):
        np.testing.assert_allclose(w.q[i], q[start : start + 51], atol=1e-12)
        np.testing.assert_allclose(w.v[i], v[start : start + 51], atol=1e-12)


def test_efforts_keep_their_impulse_whatever_the_stamps():
    """The sum over all steps is the integral of the broken line through the samples."""
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.001, 0.02, 200))
    effort = rng.normal(size=(200, 1))
    zero = np.zeros_like(effort)
    length = time[-1] - time[0]
    w = cut_windows(time, zero, zero, effort, None, 1.0, length / 37.0)
    expected = np.sum(0.5 * (effort[1:, 0] + effort[:-1, 0]) * np.diff(time))
    np.testing.assert_allclose(w.effort.sum() * w.step, expected, rtol=1e-10)


def test_a_horizon_of_nothing_is_one_step_and_none_is_the_whole_recording():
    """The two ends of the scale."""
    recording = _smooth()
    assert cut_windows(*recording, 0.0, 1.0).effort.shape[1] == 1
    assert cut_windows(*recording, None, 1.0).effort.shape[:2] == (1, 300)


def test_blocks_of_joined_recordings_differ():
    """Two recordings share no error."""
    one = cut_windows(*_smooth(), 0.1, 0.1)
    both = joined([one, one])
    assert len(both.q) == 2 * len(one.q)
    assert not set(both.block[: len(one.q)]) & set(both.block[len(one.q) :])
    assert len(set(one.block)) == 15
    with pytest.raises(ValueError, match='steps'):
        joined([one, cut_windows(*_smooth(), 0.2, 0.1)])


def test_the_model_that_made_a_recording_scores_zero():
    """From every start, at every horizon."""
    time, q, v, level = _recording()
    w = cut_windows(time, q, v, np.vstack([level, level[-1:]]), 0.3, 0.1)
    first = np.rint(0.1 * np.arange(len(w.q)) / STEP).astype(int)
    exact = np.stack([level[i : i + 30] for i in first])
    score = score_windows(
        type(w)(q=w.q, v=w.v, effort=exact, step=w.step, block=w.block), ROBOT, W
    )
    assert score.diverged == 0
    # a stop inside a step falls on another moment when an earlier one was cut differently
    assert score.nmse_path[0] < 1e-8
    assert score.rms_end[0] < 1e-5


def test_a_robot_that_never_moves_scores_one():
    """Holding the last position is the yardstick: infinite friction is as good."""
    time, q, v, level = _recording()
    brake = np.array([1.0, 0.0, 0.0, 1e9, 0.0])
    effort = np.vstack([level, level[-1:]])
    for score in rollout_scores(time, q, np.zeros_like(v), effort, ROBOT, brake):
        np.testing.assert_allclose(score.nmse_end, 1.0, rtol=1e-9)
        np.testing.assert_allclose(score.nmse_path, 1.0, rtol=1e-9)


def test_a_wrong_model_scores_worse_the_longer_it_runs():
    """Its errors add up, in units too."""
    time, q, v, level = _recording()
    effort = np.vstack([level, level[-1:]])
    wrong = W * [1.0, 1.3, 1.0, 1.0, 1.0]
    scores = rollout_scores(time, q, v, effort, ROBOT, wrong, (0.1, 0.3, 1.0))
    assert scores[0].rms_end[0] < scores[1].rms_end[0] < scores[2].rms_end[0]
    assert all(s.rms_path[0] < s.rms_end[0] for s in scores)


def test_diverged_roll_outs_are_counted():
    """They are in no mean, and not forgotten."""
    time, q, v, level = _recording()
    effort = np.vstack([level, level[-1:]])
    blow_up = np.array([1e-5, 0.0, -1e3, 0.0, 0.0])
    score = rollout_scores(time, q, v, effort, ROBOT, blow_up, (1.0,))[0]
    assert score.diverged == score.n == 21
    assert np.isnan(score.nmse_end).all()


@pytest.mark.parametrize(
    ('change', 'found'),
    [
        ({'time': np.zeros(301)}, 'increase'),
        ({'q': np.full((301, 2), np.nan)}, 'finite'),
        ({'horizon': 4.0}, '3 s'),
    ],
)
def test_recordings_without_windows_are_refused(change, found):
    """In one line that says what was found."""
    time, q, v, effort = _smooth()
    given = {'time': time, 'q': q, 'v': v, 'effort': effort, 'horizon': 0.3, 'stride': 0.1}
    with pytest.raises(RecordingError, match=found):
        cut_windows(**(given | change))


def test_wrong_arguments_of_windows_are_refused():
    """A caller's mistake."""
    time, q, v, effort = _smooth()
    with pytest.raises(ValueError, match='stride'):
        cut_windows(time, q, v, effort, 0.3, 0.0)
    with pytest.raises(ValueError, match='q'):
        cut_windows(time, q[:, :1], v, effort, 0.3, 0.1)
