"""The best possible model of a world, and the share of its improvement a diagnosis reaches.

The best possible is the true structure, fitted to the recording that was diagnosed.

Which effects act where, of which kind and from which joint, and whether bodies differ is taken
from the answer. Their numbers are fitted to `real.mcap` by least squares, with the equations and
the fitter of the diagnosis. The search starts at the true numbers, so that no other local minimum
makes the best possible worse than it is, and bounds of the diagnosis make room for them. Bodies
that are as the nominal robot has them are not fitted, others have the prior of the diagnosis.

Of an effect outside the list the law is known but for its size. A lag of the velocity sensor
exerts no force; predictions start from positions, so there is nothing to fit. Two effects on one
command add up, as in the diagnosis; in the simulation a dead zone sees what a delay passes on.
"""

from __future__ import annotations

import copy
import csv
from dataclasses import dataclass

import numpy as np

from sgp_proof.concealed.balance import RATE_HZ, WIDTH_S, low_passed
from sgp_proof.concealed.scoring import HELD_OUT, parameter_scores
from sgp_proof.concealed.unknown import NAME, UNKNOWN
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.diagnosis.explain.candidates import fit
from sgp_ros.diagnosis.explain.fitted_model import floors
from sgp_ros.diagnosis.explain.regression import Columns
from sgp_ros.diagnosis.prove.prediction import FinalModel
from sgp_ros.diagnosis.prove.proof import prove
from sgp_ros.physics.catalogue import BACKLASH, EFFECTS
from sgp_ros.physics.effect import Effect
from sgp_ros.physics.effect_at import EffectAt
from sgp_ros.physics.parts import Quantity
from sgp_ros.physics.place import Place, joint_name
from sgp_ros.recordings.reader import open_recording
from sgp_ros.robots.nominal import nominal_model
from sgp_ros.robots.registry import load_robot
from sgp_ros.simulation.effects import Moment

LEAST = 1e-3
"""Improvement of the nMSE that must be possible, or there is nothing to score."""
_WORDS = ('kind', 'source_joint', 'encoder')
_ROUNDS = 6
"""Twice as many as the diagnosis takes; more gain less than a nat."""


@dataclass(frozen=True)
class Oracle:
    """The true structure of a world with fitted numbers."""

    nominal: object
    final: FinalModel

    @classmethod
    def fitted(cls, folder, answer):
        """Fit the structure of an answer to `folder/real.mcap`."""
        nominal = nominal_model(load_robot(str(folder / 'robot.urdf')))
        raw, tree = _trajectory(folder / 'real.mcap', nominal), nominal.tree
        equations = make_equations(raw, tree, choose_bandwidth(raw, tree))
        start = np.sqrt((equations.d**2).mean(axis=0) + floors(equations))
        model = fit(
            Columns(equations), candidates(answer, equations.motion), start,
            is_free=bool(answer['parameter_errors']), rounds=_ROUNDS,
        )  # fmt: skip
        return cls(nominal, FinalModel(model, model, equations, ()))

    def predict(self, recording):
        """Return the accelerations that it predicts on a recording."""
        return self.final.predict(_trajectory(recording, self.nominal), self.nominal.tree)

    def findings(self):
        """Return its effects as `diagnosis.json` has them."""
        model, found = self.final.model, []
        motion = model.frame.equations.motion
        for candidate in model.effects:
            numbers = candidate.report(motion)
            found.append({
                'effect': candidate.name, 'joint': joint_name(motion, candidate.place.joint),
                'parameters': {name: {'value': value} for name, value in numbers.items()},
            })  # fmt: skip
        return found


def improvements(sealed, answer, truth, out):
    """Return errors and shares of a diagnosis on the recordings that were held out.

    The best possible is the true structure fitted to the recording that was diagnosed; the share
    of the improvement by a model without any error stands beside it, and so do the errors of the
    fitted numbers.

    Args:
        sealed: folder of the recordings.
        answer: the unsealed answer.
        truth: true accelerations.
        out: folder of the diagnosis.
    """
    oracle = Oracle.fitted(sealed, answer)
    errors = {}
    for stem in HELD_OUT:
        best = oracle.predict(sealed / f'{stem}.mcap')
        errors[stem] = {
            'nominal': nominal_error(answer, stem),
            'diagnosed': error(truth, stem, *read_prediction(out / f'pred_{stem}.csv')),
            'oracle': error(truth, stem, best.time, best.acceleration),
        }
    return {
        'errors': errors,
        'improvement': {
            s: share(e['nominal'], e['diagnosed'], e['oracle']) for s, e in errors.items()
        },
        'improvement_of_truth': {
            s: share(e['nominal'], e['diagnosed'], 0.0) for s, e in errors.items()
        },
        'oracle_parameters': parameter_scores(answer, {'findings': oracle.findings()}),
    }


def effort_ratios(sealed, answer, diagnosis):
    """Return the nMSE of the effort held out, in units of that of the best possible, by joint."""
    oracle = Oracle.fitted(sealed, answer)
    raw = _trajectory(sealed / 'real_test.mcap', oracle.nominal)
    best = prove(oracle.final, raw, oracle.nominal.tree, 'real_test').nmse_after
    found = diagnosis['fit']['real_test']['nmse_after']
    return {joint: found[joint] / best[joint] for joint in best if best[joint] > 0.0}


def share(nominal, found, best):
    """Return the share of the improvement from `nominal` to `best` that an error `found` reaches.

    It is clipped to [-1, 1]: a diagnosis that is better than the best possible has all of it.
    None where the best possible is hardly better than the nominal robot, or not at all: the effect
    hardly shows there, or not even its own law predicts it from what was measured.
    """
    if nominal - best < LEAST:
        return None
    return float(np.clip((nominal - found) / (nominal - best), -1.0, 1.0))


def nominal_error(answer, stem):
    """Return the nMSE of the accelerations of the nominal robot on true signals."""
    return float(np.mean(list(answer['nmse'][stem]['acceleration_vs_truth']['nominal'].values())))


def error(truth, stem, time, acceleration):
    """Return the nMSE of predicted accelerations (n, k) at times (n,), both sides low-passed."""
    t, a = truth[f'{stem}_t'], truth[f'{stem}_a'].astype(float)
    low, high = max(t[0], time[0]), min(t[-1], time[-1])
    grid = np.arange(low + 5 * WIDTH_S, high - 5 * WIDTH_S, 1.0 / RATE_HZ)
    true, found = low_passed(grid, t, a), low_passed(grid, time, acceleration)
    return float(np.mean(((true - found) ** 2).mean(axis=0) / true.var(axis=0)))


def read_prediction(path):
    """Return times (n,) and accelerations (n, k) of a `pred_<stem>.csv`."""
    with path.open(encoding='utf-8') as file:
        table = np.array([[float(x) for x in row] for row in list(csv.reader(file))[1:]])
    return table[:, 0], table[:, 1:]


def candidates(answer, motion):
    """Return the effects of an answer where they act, with their true shapes."""
    return tuple(
        _candidate(effect, motion)
        for effect in answer['effects']
        if effect['effect'] not in EFFECTS or EFFECTS[effect['effect']].is_force
    )  # fmt: skip


def _candidate(effect, motion):
    name, numbers, tree = effect['effect'], effect['parameters'], motion.tree
    if name == NAME:
        joint = tree.moving_names.index(effect['joint'])
        return EffectAt(Unlisted(joint, numbers, tree.moving_names), Place(joint))
    stated = {k: x for k, x in numbers.items() if k in _WORDS or not isinstance(x, str)}
    found = EffectAt.stated(EFFECTS[name], effect['joint'], stated, tree)
    if found.effect is BACKLASH:
        share = numbers['motor_inertia'] / motion.mass_diagonal[:, found.place.joint].mean()
        found = found.with_shape(np.array([share, *found.shape[1:]]))
    return EffectAt(_reaching(found.effect, found.shape), found.place, found.shape)


def _reaching(effect, shape):
    """Return an effect with bounds that hold a shape with room on either side."""
    wide = copy.copy(effect)

    def bounds(motion, place):
        low, high = effect.bounds(motion, place)
        beyond, room = (shape < low) | (shape > high), abs(shape)
        return (np.where(beyond, np.minimum(low, shape - room), low),
                np.where(beyond, np.maximum(high, shape + room), high))  # fmt: skip

    wide.bounds = bounds
    return wide


class Unlisted(Effect):
    """An effect outside the catalogue as one whose only coefficient is its size."""

    name = NAME
    quantities = (Quantity('a', '1'),)
    linear = ('a',)

    def __init__(self, joint, numbers, names):
        source = names.index(numbers['source']) if numbers['source'] in names else -1
        unit = numbers | {'a': 1.0, 'source': source}
        self.joint = joint
        (self.action,) = UNKNOWN[numbers['kind']](joint, unit, names)

    def _force(self, moment):
        if self.action.force is not None:
            return self.action.force(moment)
        return self.action.drive(moment) - moment.drive[self.joint]

    def columns(self, motion, _place, _shape):
        """Return the force for a size of 1, (n, 1)."""
        rows = zip(motion.time, motion.position, motion.velocity, motion.effort, strict=True)
        return np.array([[self._force(Moment(*row, np.zeros(0)))] for row in rows])


def _trajectory(path, nominal):
    events = open_recording(str(path)).events(None, None)
    return collect(events, nominal.robot, nominal.stated)
