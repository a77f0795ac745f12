"""How much of the possible improvement of predicted accelerations a diagnosis reaches."""

from __future__ import annotations

import csv

import numpy as np
from scipy.ndimage import gaussian_filter1d

from sgp_proof.concealed.oracle import Oracle
from sgp_proof.concealed.rates import HELD_OUT
from sgp_proof.concealed.scoring import parameter_scores

LEAST = 1e-3
"""Improvement of the nMSE that must be possible, or there is nothing to score."""
_WIDTH_S, _RATE_HZ = 0.012, 200.0


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
    grid = np.arange(low + 5 * _WIDTH_S, high - 5 * _WIDTH_S, 1.0 / _RATE_HZ)
    true, found = _smoothed(grid, t, a), _smoothed(grid, time, acceleration)
    return float(np.mean(((true - found) ** 2).mean(axis=0) / true.var(axis=0)))


def read_prediction(path):
    """Return times (n,) and accelerations (n, k) of a `pred_<stem>.csv`."""
    with path.open(encoding='utf-8') as file:
        table = np.array([[float(x) for x in row] for row in list(csv.reader(file))[1:]])
    return table[:, 0], table[:, 1:]


def _smoothed(grid, t, x):
    even = np.column_stack([np.interp(grid, t, column) for column in x.T])
    return gaussian_filter1d(even, _WIDTH_S * _RATE_HZ, axis=0, mode='nearest')
