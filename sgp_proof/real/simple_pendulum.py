"""The DFKI simple pendulum, with its own weight and with the heavier one.

python -m sgp_proof.real.simple_pendulum

Each recording is cut before hands or a balancing controller act on it. Coefficients of one
recording are scored on itself and, where the pendulum is the same, on the other.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from sgp_proof.environment import environment
from sgp_proof.real.pendulum_recordings import parameters, read_run, regression, row, with_terms
from sgp_ros.batch.rollout_fit import RolloutFitOptions, fit_rollouts
from sgp_ros.batch.rollout_scores import score_windows
from sgp_ros.robots.simple_pendulum import SIMPLE_PENDULUM

DATA = Path(__file__).parents[3] / 'shared' / 'data' / 'dfki_simple_pendulum'
RESULT = Path(__file__).parent / 'results' / 'simple_pendulum.json'
SECONDS = {'energy_shaping': 3.9, 'sac': 3.9, 'energy_shaping_1kg': 7.0}
SAME = {'energy_shaping': ('sac',), 'sac': ('energy_shaping',), 'energy_shaping_1kg': ()}
MODELS = {'rigid': 2, 'viscous': 3, 'Coulomb': 4, 'offset': 5}
LOWER = {'J': 1e-6, 'Fv': 0.0, 'Fc': 0.0}
STRIDE, STEP = 0.05, 0.01
FITTED = {'1 s': 1.0, 'whole': None}
HORIZONS = {'0.3 s': 0.3, '1 s': 1.0, 'whole': None}
GRAVITY = 9.81


def _run(name):
    table = np.genfromtxt(DATA / f'{name}.csv', delimiter=',', names=True)
    inside = table['t_s'] <= SECONDS[name]
    columns = (table[c][inside] for c in ('t_s', 'q_rad', 'tau_Nm'))
    time, q, tau = columns
    return read_run(name, time, q[:, None], tau[:, None])


def _scores(run, robot, W):
    return {
        name: row(score_windows(run.windows(horizon, STRIDE, STEP), robot, W))
        for name, horizon in HORIZONS.items()
    }


def _fit(run, robot, start, horizon):
    known = {c.name for c in robot.coefficients}
    options = RolloutFitOptions(lower={k: v for k, v in LOWER.items() if k in known})
    return fit_rollouts(run.windows(horizon, STRIDE, STEP), robot, start, options)


def _recording(run, runs):
    """Per fitted horizon and model: coefficients and scores.

    Regression ends far off as soon as friction is in it, so each model starts from the one before,
    and the fit to the whole run from that to windows.
    """
    results, found = {}, {}
    for horizon, seconds in FITTED.items():
        before = regression(with_terms(SIMPLE_PENDULUM, 2), [run])
        results[horizon] = {}
        for model, terms in MODELS.items():
            robot = with_terms(SIMPLE_PENDULUM, terms)
            start = found.get(model, np.append(before, np.zeros(terms - len(before))))
            fit = _fit(run, robot, start, seconds)
            before = found[model] = fit.W
            results[horizon][model] = _result(run, runs, robot, fit)
            whole = [results[horizon][model]['in_sample']['whole']]
            whole += [o['whole'] for o in results[horizon][model]['held_out'].values()]
            print(
                f'{run.name:20s}{horizon:6s}{model:8s} W {np.round(fit.W, 4)} '
                f'whole run rms [rad] {[round(w["rms_path_rad"][0], 5) for w in whole]}',
                flush=True,
            )
    return results


def _result(run, runs, robot, fit):
    return {
        'parameters': parameters(robot, fit),
        'in_sample': _scores(run, robot, fit.W),
        'held_out': {o: _scores(runs[o], robot, fit.W) for o in SAME[run.name]},
        'is_converged': fit.is_converged,
    }


def _weight(model):
    """What J and G say of a point mass at a length, in units of the measured torque."""
    J, G = (model['parameters'][c]['value'] for c in ('J', 'G'))
    return {'length_m': GRAVITY * J / G, 'mass_kg': (G / GRAVITY) ** 2 / J, 'G_N_m': G}


def _change(weights):
    heavy = weights['energy_shaping_1kg']
    return {
        name: {
            'mass_kg': heavy['mass_kg'] - weights[name]['mass_kg'],
            'G_ratio': heavy['G_N_m'] / weights[name]['G_N_m'],
        }
        for name in ('energy_shaping', 'sac')
    }


def main() -> None:
    """Fit every model on every recording, compare the two weights, write the result."""
    runs = {name: _run(name) for name in SECONDS}
    recordings = {name: _recording(run, runs) for name, run in runs.items()}
    weights = {
        horizon: {name: _weight(found[horizon]['offset']) for name, found in recordings.items()}
        for horizon in FITTED
    }
    change = {horizon: _change(weights[horizon]) for horizon in FITTED}
    for horizon in FITTED:
        print(horizon, weights[horizon], change[horizon], sep='\n')
    result = {
        'schema': 1, 'environment': environment(), 'seconds': SECONDS, 'recordings': recordings,
        'equivalent_point_mass': weights, 'change_with_the_heavier_weight': change,
    }  # fmt: skip
    RESULT.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
