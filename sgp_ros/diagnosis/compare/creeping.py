"""Dry friction that a robot file states, as it creeps before it slides.

Files state Coulomb friction, which acts at once; that of a machine builds up over a way. What this
leaves at each reversal is no physics that the file lacks, and no other law should explain it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import Equations, make_equations
from sgp_ros.diagnosis.compare.trajectory import RawTrajectory
from sgp_ros.diagnosis.criteria import ALIKE, INDEPENDENT_ROWS
from sgp_ros.physics.catalogue import COULOMB_FRICTION, HYSTERESIS
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.rigid.tree import Tree

_WAYS = 16
"""Ways over which friction may build up that are compared, from least to greatest."""
_UNLIKE = 0.5
"""Part of its level by which friction that creeps may differ from what is stated, and may act at
once beside it. A law of another size, such as that of a bundle of cables, is none of the file."""


def creeping_friction(raw: RawTrajectory, tree: Tree) -> Mapping[str, EffectAt]:
    """Return how the Coulomb friction that is stated at some joints creeps, by joint.

    It has the stated level; the way over which it builds up is the one that leaves least beside
    bodies, rotor and friction of any size. Joints where it explains no more than that are absent.

    Args:
        raw: the recording, with what the robot file states.
        tree: nominal robot.
    """
    stated = [x for x in raw.stated if x.effect is COULOMB_FRICTION]
    if raw.approach is not None or not stated:
        return {}
    equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
    moves = equations.motion.moves
    found = {x.joint: _creeping(equations, x) for x in stated if moves[x.place.joint]}
    return {joint: x for joint, x in found.items() if x is not None}


def with_creeping(raw: RawTrajectory, creeping: Mapping[str, EffectAt]) -> RawTrajectory:
    """Return a recording of a robot whose stated friction creeps at some joints.

    Coulomb friction is taken off as a law of its own: it still says that it may hold the joint.
    """
    off = [
        replace(x, coefficients=-x.coefficients)
        for x in raw.stated if x.effect is COULOMB_FRICTION and x.joint in creeping
    ]  # fmt: skip
    return replace(raw, stated=(*raw.stated, *off, *creeping.values()))


def creeping_remark(creeping: Mapping[str, EffectAt]) -> tuple[str, ...]:
    """Say at which joints the friction of the robot file creeps; nothing without."""
    if not creeping:
        return ()
    said = ', '.join(f'{joint} ({float(x.shape[0]):.2g})' for joint, x in creeping.items())
    return (f'The Coulomb friction of the robot file builds up over a way [rad or m] at {said}.',)


def _creeping(equations: Equations, stated: EffectAt) -> EffectAt | None:
    """Return stated Coulomb friction as it creeps; None where it is as well without."""
    j, motion = stated.place.joint, equations.motion
    dry = stated.force(motion)[:, [j]]
    beside = np.column_stack([motion.velocity[:, j], motion.acceleration[:, j], dry[:, 0]])
    X = np.column_stack([equations.bases[j], equations.compact(beside, j, is_inertial=False)])
    scale = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    Q = np.linalg.qr(X / scale)[0]

    def left(y: np.ndarray) -> float:
        rest = y - Q @ (Q.T @ y)
        return max(float(rest @ rest), 1e-300)

    low, high = (float(x[0]) for x in HYSTERESIS.bounds(motion, stated.place))
    trials = [
        replace(stated, effect=HYSTERESIS, shape=np.array([way]))
        for way in np.geomspace(low, high, _WAYS)
    ]
    columns = np.column_stack([x.force(motion)[:, j] for x in trials]) - dry
    changes = equations.compact(columns, j, is_inertial=False).T
    rests = [left(equations.d[:, j] - change) for change in changes]
    best = int(np.argmin(rests))
    gain = 0.5 * INDEPENDENT_ROWS * math.log(left(equations.d[:, j]) / rests[best])
    if gain <= ALIKE or best in {0, _WAYS - 1}:
        return None
    # of friction of any level that acts at once, beside any that creeps
    A = np.column_stack([changes[best], X / scale])
    found = np.linalg.lstsq(A, equations.d[:, j], rcond=None)[0]
    creeps, more = found[0], found[-1] / scale[-1]
    at_once = 1.0 + more - creeps
    return trials[best] if abs(creeps - 1.0) < _UNLIKE and abs(at_once) < _UNLIKE else None
