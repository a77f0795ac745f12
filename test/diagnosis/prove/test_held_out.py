"""Blocks of a recording that nothing is fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.pipeline import diagnose
from sgp_ros.diagnosis.prove.held_out import (
    HELD_OUT,
    LEAST_BLOCK_S,
    MOST_BLOCKS,
    SHARE,
    block_count,
    part_of,
    split,
    split_sentence,
)
from test.diagnosis.worlds import CHAINS, PERIOD, World, events_of, simulate

PAUSE_S = 1.0


@pytest.fixture(scope='module')
def world():
    """A pendulum with a spring, for two blocks."""
    return simulate(CHAINS[1], 17, 20.0, force=lambda t, q, v: (-2.0 * (q[0] - 0.3),))


@pytest.fixture(scope='module')
def kept(robots, world):
    """A diagnosis that holds blocks out."""
    return diagnose(events_of(world), *robots[1], {}, holds_out=True)


def _with_pause(world, at):
    """Return the world with a second in which nothing was recorded."""
    late = np.where(np.arange(len(world.time)) >= at, PAUSE_S, 0.0)
    return replace(world, time=world.time + late)


def _seen(world, robot):
    middle = 0.5 * (world.command + np.vstack([world.command[:1], world.command[:-1]]))
    return collect(events_of(world, velocity=world.velocity, effort=middle), robot)


def test_every_sample_is_on_one_side_with_all_that_belongs_to_it(robots, world):
    """On the clock of the whole; commands keep their past."""
    raw = _seen(world, robots[1][0])
    learned, held = split(raw)
    rows = np.concatenate([np.searchsorted(raw.time, part.time) for part in (learned, held)])
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(raw.time)))
    assert len(held.time) == pytest.approx(SHARE * len(raw.time), abs=2)
    for part in (learned, held):
        at = np.searchsorted(raw.time, part.time)
        for name in ('time', 'position', 'velocity', 'effort'):
            np.testing.assert_array_equal(getattr(part, name), getattr(raw, name)[at])
        np.testing.assert_allclose(
            part.drive.effort(0, delay=0.02), raw.drive.effort(0, delay=0.02)[at], atol=1e-6
        )


def test_what_is_left_out_may_be_shorter_than_any_stretch_that_is_kept(robots, world):
    raw = _seen(world, robots[1][0])
    is_kept = np.ones(len(raw.time), dtype=bool)
    is_kept[1000:1010] = False
    part = part_of(raw, is_kept)
    np.testing.assert_array_equal(part.time, raw.time[is_kept])
    assert [s.start for s in part.segments] == [0, 1000]
    with pytest.raises(ValueError, match='rows in a row are kept'):
        part_of(raw, ~is_kept)


def test_blocks_are_spread_and_the_last_one_is_the_end(robots, world):
    """A slow drift shows behind everything that was learned."""
    raw = _seen(world, robots[1][0])
    learned, held = split(raw)
    assert block_count(raw) == len(held.segments) == 2
    assert held.time[-1] == raw.time[-1] > learned.time[-1]
    starts = [held.time[s.start] for s in held.segments]
    np.testing.assert_allclose(starts, [7.5, 17.5], atol=2 * PERIOD)


def test_no_stretch_crosses_a_pause(robots, world):
    """Neither one that was in the recording nor one that a block has left."""
    raw = _seen(_with_pause(world, 1600), robots[1][0])
    for part in split(raw):
        for s in part.segments:
            assert np.diff(part.time[s]).max() < 1.5 * raw.step
        assert sum(s.stop - s.start for s in part.segments) == len(part.time)


@pytest.mark.parametrize('seconds', [5.0, 15.0, 300.0])
def test_blocks_are_never_too_short_for_roll_outs(robots, world, seconds):
    """As many as can be spared, at most four; none of a short recording."""
    raw = _seen(world, robots[1][0])
    n = round(seconds / raw.step)
    longer = replace(raw, time=raw.step * np.arange(n))
    blocks = block_count(longer)
    assert blocks == {5.0: 0, 15.0: 1, 300.0: MOST_BLOCKS}[seconds]
    assert blocks * LEAST_BLOCK_S <= SHARE * seconds
    assert ('Nothing' in split_sentence(longer)) == (blocks == 0)
    if not blocks:
        with pytest.raises(ValueError, match='too short'):
            split(longer)


@pytest.mark.long
def test_nothing_is_learned_from_what_is_held_out(robots, world, kept):
    """Another motion there changes the proof, and no parameter, evidence or probability."""
    at = (world.time % 10.0 >= 7.5) & (world.time % 10.0 < 10.0 - 0.5 * PERIOD)
    noise = np.random.default_rng(8).normal(0.0, 0.01, (at.sum(), 1))
    other = World(world.time, world.position.copy(), world.velocity, world.acceleration,
                  world.command)  # fmt: skip
    other.position[at] += noise
    one, two = kept, diagnose(events_of(other), *robots[1], {}, holds_out=True)
    (spring,) = one.findings
    assert (spring.effect, spring.joint) == ('spring', 'joint0')
    for f, g in zip(one.findings, two.findings, strict=True):
        assert {n: p.value for n, p in g.parameters.items()} == pytest.approx(
            {n: p.value for n, p in f.parameters.items()}, rel=1e-6
        )
        assert g.probability == pytest.approx(f.probability, rel=1e-6)
        assert g.log_bayes_factor == pytest.approx(f.log_bayes_factor, rel=1e-6)
    assert two.proofs['train'].nmse_after == pytest.approx(one.proofs['train'].nmse_after)
    assert (
        two.proofs[HELD_OUT].nmse_after['joint0'] > 10 * one.proofs[HELD_OUT].nmse_after['joint0']
    )


@pytest.mark.long
def test_the_proof_shows_blocks_only_where_nothing_else_was_given(robots, world, kept):
    """And says so; the node asks for none."""
    assert list(kept.proofs) == ['train', HELD_OUT]
    assert 'held out (5 of 20 s)' in kept.remarks[0]
    assert kept.predictions == {}
    proof = kept.proofs[HELD_OUT]
    assert proof.nmse_after['joint0'] < 1e-3 * proof.nmse_before['joint0']
    assert proof.rollouts > 8
    plain = diagnose(events_of(world), *robots[1], {})
    assert list(plain.proofs) == ['train']
    assert plain.remarks == ()
