"""All recordings of a diagnosis on their grids: learned from, kept back, held out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.creeping import creeping_friction, creeping_remark, with_creeping
from sgp_ros.diagnosis.compare.open_bodies import open_remark, with_open_bodies
from sgp_ros.diagnosis.compare.settled import LEAST_POSES, collect_settled
from sgp_ros.diagnosis.compare.several import join
from sgp_ros.diagnosis.compare.sufficiency import (
    at_rest,
    require_motion,
    require_rows,
    without_motors,
)
from sgp_ros.diagnosis.compare.thinning import thinned
from sgp_ros.diagnosis.compare.trajectory import Bandwidth, RawTrajectory, collect, observe
from sgp_ros.diagnosis.criteria import COUNTED_SHARE
from sgp_ros.diagnosis.prove.held_out import HELD_OUT, keep_back
from sgp_ros.diagnosis.setup.correction import Correction
from sgp_ros.diagnosis.setup.evidence import Probe
from sgp_ros.diagnosis.setup.search import search
from sgp_ros.engine.config import EngineConfig
from sgp_ros.engine.samples import Event, JointSample, frozen_array
from sgp_ros.errors import RecordingError
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree
from sgp_ros.robots.gains import Gains
from sgp_ros.robots.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """Prior knowledge of the machine beside its bodies.

    Attributes:
        robot: names, actuated joints and gains.
        stated: effects that the nominal robot has, beside those of its tree.
        config: settings of the intake.
        gains: of drives that hold position targets; None where commands are efforts.
        is_static: whether the recordings hold settled points, one row a pose.
    """

    robot: Robot
    stated: tuple[EffectAt, ...]
    config: EngineConfig
    gains: Gains | None = None
    is_static: bool = False

    def collected(
        self, events: Iterable[Event], least_step: float = 0.0, least_poses: int = LEAST_POSES
    ) -> RawTrajectory:
        """Return a recording on its grid."""
        if self.is_static:
            return collect_settled(events, self.robot, self.stated, self.config, least_poses)
        return collect(
            events, self.robot, self.stated, self.config, least_step=least_step, gains=self.gains
        )


@dataclass(frozen=True, eq=False)
class Recordings:
    """Recordings to learn from, kept-back blocks and held-out recordings.

    Attributes:
        names: stems of what is learned from.
        learned: all of it.
        kept: blocks of it that are kept back, by name.
        held: held-out recordings, by stem.
        still: joints that do not move.
        remarks: for the user.
        unstated: bodies that the robot's file leaves open.
    """

    names: tuple[str, ...]
    learned: RawTrajectory
    kept: Mapping[str, RawTrajectory]
    held: Mapping[str, RawTrajectory]
    still: tuple[str, ...]
    remarks: tuple[str, ...]
    unstated: tuple[int, ...] = ()

    def thinned(self) -> Recordings:
        """Return the recordings to learn from, and their kept blocks, on the rows they need."""
        kept = {name: thinned(raw) for name, raw in self.kept.items()}
        return replace(self, learned=thinned(self.learned), kept=kept)

    def corrected(self, correction: Correction) -> Recordings:
        """Return the recordings as they were."""
        return self.changed(correction.recording)

    def changed(self, change: Callable[[RawTrajectory], RawTrajectory]) -> Recordings:
        """Return all recordings after a change of each."""
        return replace(
            self,
            learned=change(self.learned),
            kept={name: change(raw) for name, raw in self.kept.items()},
            held={stem: change(raw) for stem, raw in self.held.items()},
        )


def gather(
    several: Mapping[str, Iterable[Event]],
    tests: Mapping[str, Iterable[Event]],
    tree: Tree,
    known: Knowledge,
    *,
    holds_out: bool,
) -> Recordings:
    """Return recordings on grids of one step.

    Args:
        several: events to learn from, by stem.
        tests: events of held-out recordings, by stem.
        tree: nominal robot.
        known: what is known beside it.
        holds_out: whether blocks of the recordings are kept back for the proof.

    Raises:
        RecordingError: nothing can be used, or nothing moves.
    """
    raws, still = _collected(several, tree, known)
    held = {stem: known.collected(test, least_poses=1) for stem, test in tests.items()}
    learned, kept, remarks = _kept_back(raws) if holds_out else (join(raws), {}, ())
    if still:
        remarks += (f'Joints that do not move cannot be diagnosed: {", ".join(still)}.',)
    return Recordings(tuple(several), learned, kept, held, still, remarks)


def _collected(
    several: Mapping[str, Iterable[Event]], tree: Tree, known: Knowledge
) -> tuple[list[RawTrajectory], tuple[str, ...]]:
    """Return the recordings on grids of one step, and the joints that are still in all."""
    if known.is_static:
        return [known.collected(events) for events in several.values()], ()
    parts = [list(events) for events in several.values()]
    still = [require_motion(events, known.robot.name, tree.moving_names) for events in parts]
    raws = [known.collected(events) for events in parts]
    step = max(raw.step for raw in raws)
    raws = [
        raw if raw.step == step else known.collected(events, step)
        for raw, events in zip(raws, parts, strict=True)
    ]
    raws = [
        at_rest(raw, np.isin(tree.moving_names, names))
        for raw, names in zip(raws, still, strict=True)
    ]
    return raws, tuple(name for name in still[0] if all(name in names for names in still))


def _kept_back(
    raws: Sequence[RawTrajectory],
) -> tuple[RawTrajectory, dict[str, RawTrajectory], tuple[str, ...]]:
    """Return what to learn from, what is held out of it by name, and what is to be said."""
    parts = [keep_back(raw) for raw in raws]
    kept = [held[HELD_OUT] for _, held, _ in parts if held]
    said = dict.fromkeys(remark for _, _, remarks in parts for remark in remarks)
    learned = join([part for part, _, _ in parts])
    return learned, {HELD_OUT: join(kept)} if kept else {}, tuple(said)


def prepared(
    recordings: Recordings, tree: Tree, unstated: tuple[int, ...]
) -> tuple[Recordings, Tree]:
    """Return recordings and robot with what they show of its motors, bodies and friction.

    Args:
        recordings: gathered.
        tree: nominal robot.
        unstated: bodies that its file leaves open.
    """
    tree, passive = without_motors(recordings.learned, tree)
    tree = with_open_bodies(recordings.learned, tree, unstated)
    creeping = creeping_friction(recordings.learned, tree)
    said = (*passive, *open_remark(tree, unstated), *creeping_remark(creeping))
    changed = recordings.changed(lambda raw: with_creeping(raw, creeping))
    return replace(changed, unstated=unstated, remarks=(*recordings.remarks, *said)), tree


def driven(events: Iterable[Event], tree: Tree, known: Knowledge) -> list[Event]:
    """Return a recording of position control as one of efforts: those that its gains make.

    Args:
        events: with targets.
        tree: nominal robot.
        known: with the gains.
    """
    raw = known.collected(events)
    if raw.gains is None:
        return list(events)
    rate = 1.0 / raw.step
    motion = observe(raw, tree, Bandwidth(0.4 * rate, 0.4 * rate))
    return [
        JointSample(raw.start_ns + round(t * 1e9), tree.moving_names, *map(frozen_array, rows))
        for t, *rows in zip(raw.time, raw.position, motion.velocity, motion.effort, strict=True)
    ]


def setup_remarks(events: Iterable[Event], tree: Tree, known: Knowledge) -> tuple[str, ...]:
    """Return what to check of how a robot is connected before its bodies are estimated.

    Searched only where bodies and everyday friction leave a residual that counts as physics.
    Recordings that cannot be used are refused by the later stages.

    Args:
        events: of a recording.
        tree: nominal robot.
        known: what is known beside it.
    """
    try:
        raw = known.collected(events)
        bandwidth = choose_bandwidth(raw, tree)
        require_rows(raw, bandwidth)
    except RecordingError:
        return ()
    probe = Probe(raw, tree, bandwidth)
    left = probe.agreement(Correction.none(tree.size)).left.max()
    if left < COUNTED_SHARE or not probe.full.effort.any():
        return ()
    return tuple(f'Check the set-up. {e.remedy}' for e in search(probe).errors)
