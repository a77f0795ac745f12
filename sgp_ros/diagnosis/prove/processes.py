"""Decision on Z beside the physics: it stays only where predictions are not worse.

Z is learned from one-step errors, and a small error of a force that pushes the wrong way adds up
along a motion. So each process is learned again without each part of the recording in turn, and
rolled out over that part: if the positions are worse than by physics alone, its weight is zero.
Held-out recordings take no part in this choice; a remark says where Z does harm there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sgp_ros.diagnosis.compare.equations import Equations
from sgp_ros.diagnosis.criteria import REMAINDER_SHARE
from sgp_ros.diagnosis.decide.decision import Decision
from sgp_ros.diagnosis.decide.differences import Several
from sgp_ros.diagnosis.decide.reasons import apart
from sgp_ros.diagnosis.locate.remainder import PARTS, Remainder, learn_remainder, parts_of
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.prove.rollouts import RolloutWindows, cut, roll_out
from sgp_ros.diagnosis.result import Proof


def learned_processes(equations: Equations, decision: Decision) -> tuple[Remainder, ...]:
    """Return Z of joints that no effect describes, at most the two with the largest residual."""
    left = (decision.model.mean_square / equations.power)[list(decision.unknown)]
    joints = [
        decision.unknown[i] for i in np.argsort(-left) if left[i] > REMAINDER_SHARE * left.max()
    ]
    found = [learn_remainder(equations, decision.model.residual, j) for j in joints[:2]]
    return tuple(r for r in found if r is not None)


def kept_processes(final: FinalModel) -> tuple[tuple[Remainder, ...], tuple[str, ...]]:
    """Return the processes of a final model that do no harm to roll-outs, and remarks.

    One after the other joins those that were kept. Physics that a constant effort beats is no
    yardstick: what explains such a joint is kept. Cost: one roll-out of the recording each.
    """
    if not final.remainders or final.equations.motion.is_static:  # no motion to roll out
        return (), ()
    names = final.equations.motion.tree.joint_names
    windows, part = _windows(final)
    effort = final.equations.filter(final.equations.motion.effort)
    is_empty = final.model.mean_square > effort.var(axis=0)
    kept: tuple[Remainder, ...] = ()
    remarks: tuple[str, ...] = ()
    before = left_out_errors(final, windows, part, kept)
    for remainder in final.remainders:
        after = left_out_errors(final, windows, part, (*kept, remainder))
        ended = np.isfinite(before)
        ratio = after[ended].sum() / max(before[ended].sum(), 1e-300)
        if ratio <= 1.0 or is_empty[remainder.joint]:
            kept, before = (*kept, remainder), after
            continue
        said = (
            f'Z of {names[remainder.joint]} was dropped: on parts that it was not learned from, '
            f'it makes the error of roll-outs {max(ratio, 1.001):.4g} times that of the physics '
            'alone.'
        )
        remarks = (*remarks, said)
    return kept, remarks


def _windows(final: FinalModel) -> tuple[RolloutWindows, np.ndarray]:
    """Return windows of the recording that was learned from, and the part each lies in, (m,)."""
    equations = final.equations
    low = equations.filter
    windows = cut(equations.motion, len(low.taps) // 2)
    part = parts_of(len(low.rows), 1)
    row = np.clip(np.searchsorted(low.rows, windows.first), 0, len(part) - 1)
    return windows, part[row]


def left_out_errors(
    final: FinalModel,
    windows: RolloutWindows,
    part: np.ndarray,
    remainders: tuple[Remainder, ...],
) -> np.ndarray:
    """Return the errors of roll-outs with processes that never saw the part they predict.

    Args:
        final: model and equations.
        windows: of the recording that was learned from, m.
        part: in which each lies, (m,).
        remainders: processes beside the model; none for physics alone.

    Returns:
        Squared errors relative to holding the position, summed over joints, (m,); infinite where
        a window does not end with finite numbers.
    """
    rows = parts_of(len(final.equations.d), 1)
    yardstick = np.maximum(windows.held.mean(axis=0), 1e-300)
    found = np.full(len(part), np.inf)
    for i in range(PARTS):
        there = replace(windows, first=windows.first[part == i])
        if not len(there.first):
            continue
        learned = tuple(r.without(rows == i) for r in remainders)
        q, ended = roll_out(there, final.model, final.equations, learned)
        errors = (there.squared(q) / yardstick).sum(axis=1)
        found[part == i] = np.where(ended, errors, np.inf)
    return found


def final_model(
    several: Several, equations: Equations
) -> tuple[FinalModel, tuple[Remainder, ...], tuple[str, ...]]:
    """Return the final model, all processes that were learned, and remarks on them."""
    learned = learned_processes(several.equations, several.decision)
    final = FinalModel(several.model, several.comparison.nominal, equations, learned)
    kept, remarks = kept_processes(final)
    return replace(final, remainders=kept), learned, remarks


def harm(
    remainders: tuple[Remainder, ...],
    names: tuple[str, ...],
    plain: Mapping[str, Proof],
    final: Mapping[str, Proof],
) -> tuple[str, ...]:
    """Say where held-out recordings are predicted worse with Z than by physics alone.

    Args:
        remainders: processes of the final model.
        names: of the joints.
        plain: proofs of physics alone, by stem of the held-out recordings.
        final: proofs with Z.
    """
    found = []
    for stem, alone in plain.items():
        for remainder in remainders:
            joint = names[remainder.joint]
            for what, without, beside in (
                ('effort', alone.nmse_after, final[stem].nmse_after),
                ('roll-outs', alone.rollout_after, final[stem].rollout_after),
            ):
                if beside.get(joint, 0.0) > without.get(joint, np.inf):
                    now, then = apart(beside[joint], without[joint])
                    found.append(
                        f'Z of {joint} makes predictions worse in {stem}: the nMSE of its {what} '
                        f'is {now}, with the physics alone {then}.'
                    )
    return tuple(found)
