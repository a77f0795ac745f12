"""Results of other tools on the worlds with unlisted laws.

    python -m sgp_proof.concealed.baselines DIR [--name unlisted_baselines]

Each gets what `sgp diagnose` has at the same stage: smoothed motion, the rows of a low-passed
regression, and the effort that the nominal robot does not explain. Sparse regression chooses from
a generous library at each joint: Lasso with cross-validated penalty (scikit-learn), sequentially
thresholded least squares (PySINDy; its threshold by the last quarter of the rows). Symbolic
regression (Operon) looks for one formula of all positions and velocities at each joint. A Gaussian
process without names (scikit-learn, squared exponential with a length for each position and
velocity, on at most 600 rows) only predicts. Formulas are scored as those of any tool are.
"""

from __future__ import annotations

import argparse
import itertools
import json
import re
import time
import warnings
from pathlib import Path

import numpy as np

from sgp_proof.concealed.unlisted import SAME, law_error
from sgp_proof.result_files import RESULTS, write_result
from sgp_ros.apps.recorded import read_events
from sgp_ros.diagnosis.compare.bandwidth import choose_bandwidth
from sgp_ros.diagnosis.compare.equations import make_equations
from sgp_ros.diagnosis.compare.trajectory import collect
from sgp_ros.physics.formula import read_formula
from sgp_ros.robots.registry import load_robot
from sgp_ros.robots.urdf_robot import nominal_tree

OWN = ('{q}', '{q}**2', '{q}**3', 'sin({q})', 'cos({q})', 'sin(2*{q})', 'cos(2*{q})', 'exp({q})',
       'exp(-{q})', '{v}', '{v}**2', '{v}**3', 'abs({v})*{v}', 'abs({v})', 'sign({v})',
       'sqrt(abs({v}))*sign({v})', 'tanh({v})', 'tanh(10*{v})')  # fmt: skip
"""Terms in position and velocity of every joint."""
PAIRS = ('{q}*{v}', '{q}**2*{v}', '{q}*sign({v})', '{q}**2*sign({v})', 'abs({q})*{v}',
         '{q}*abs({v})*{v}', 'abs({v})*{q}', '{v}*{w}', '{q}*{r}', 'abs({w})*sign({v})',
         'abs({w})*{v}', '{w}*abs({w})')  # fmt: skip
"""Terms in position q and velocity v of one joint, and r and w of another or the same."""
SHARE = 0.004
"""Share of the mean squared effort from which a force counts, as in the schema."""
ROWS, SEED = 600, 0
THRESHOLDS = np.geomspace(1e-3, 0.3, 9)
"""Of scaled columns, in parts of the root mean square of what is to be explained."""

SYMBOLS = 'add,sub,mul,div,sin,tanh,abs,sqrt,constant,variable'
LONGEST, BUDGET_S = 25, 20
"""Of a formula of symbolic regression: its nodes, and the time for each joint [s]."""


def library(joints):
    """Return the texts of all terms for joints of these names."""

    def signals(name, other):
        return {'q': f'q[{name}]', 'v': f'dq[{name}]', 'r': f'q[{other}]', 'w': f'dq[{other}]'}

    found = [t.format(**signals(name, name)) for name in joints for t in OWN]
    found += [t.format(**signals(*pair)) for pair in itertools.product(joints, joints)
              for t in PAIRS]  # fmt: skip
    return list(dict.fromkeys(['1 + 0*' + found[0], *found]))


def columns(texts, motion):
    """Return the terms in a motion, (n, m)."""
    names = motion.tree.moving_names
    channel = {'q': motion.position, 'dq': motion.velocity}
    found = []
    for text in texts:
        at = read_formula(text, is_law=True).compiled(
            lambda _name: None,
            lambda kind, joint: lambda _at: channel[kind][:, names.index(joint)],
        )
        with np.errstate(all='ignore'):
            found.append(np.nan_to_num(at(None), posinf=0.0, neginf=0.0))
    return np.column_stack(found)


def equations_of(path, robot, tree):
    """Return the equations of a recording."""
    raw = collect(read_events(str(path), None, None, []), robot)
    return make_equations(raw, tree, choose_bandwidth(raw, tree))


def lasso(X, y):
    """Return coefficients (m,) by the Lasso, its penalty by cross-validation over time."""
    from sklearn.linear_model import LassoCV  # noqa: PLC0415 - an extra

    return LassoCV(cv=5, max_iter=20_000, alphas=40, fit_intercept=False).fit(X, y).coef_


def stlsq(X, y):
    """Return coefficients (m,) by sequentially thresholded least squares."""
    from pysindy.optimizers import STLSQ  # noqa: PLC0415 - an extra

    first = 3 * len(y) // 4
    best, least = np.zeros(X.shape[1]), np.inf
    for threshold in THRESHOLDS * np.sqrt((y**2).mean()):
        c = STLSQ(threshold=threshold, alpha=1e-6).fit(X[:first], y[:first, None]).coef_[0]
        left = float(((y[first:] - X[first:] @ c) ** 2).mean())
        if left < least:
            best, least = c, left
    kept = best != 0.0
    c = np.zeros_like(best)
    if kept.any():
        c[kept] = np.linalg.lstsq(X[:, kept], y, rcond=None)[0]
    return c


def _sparse(method, texts, train, far):
    """Return what a library method says of one world: findings, and what it leaves far away."""
    names, k = train.motion.tree.moving_names, train.d.shape[1]
    raw, raw_far = columns(texts, train.motion), columns(texts, far.motion)
    findings, left = {}, np.empty(k)
    for j in range(k):
        X = train.compact(raw, j, is_inertial=False)
        size = np.sqrt((X**2).mean(axis=0)) + 1e-12
        c = method(X / size, train.d[:, j]) / size
        share = float(((X @ c) ** 2).mean() / train.power[j])
        away = far.d[:, j] - far.compact(raw_far, j, is_inertial=False) @ c
        left[j] = (away**2).mean()
        if share > SHARE:
            used = np.flatnonzero(c)
            formula = ' + '.join(f'c{i}*({texts[i]})' for i in used)
            findings[names[j]] = {
                'formula': f'tau_x[{names[j]}] = {formula}', 'share': share, 'terms': len(used),
                'parameters': {f'c{i}': {'value': float(c[i])} for i in used},
            }  # fmt: skip
    return findings, left


def _states(equations):
    """Return positions and velocities of all joints at the rows of the regression, (N, 2 k)."""
    motion, rows = equations.motion, equations.filter.rows
    return np.hstack([motion.position[rows], motion.velocity[rows]])


def formula_of(text, joints):
    """Return a formula of Operon in X1, X2, ..., as one of positions and velocities of joints."""
    signals = [f'{x}[{name}]' for x in ('q', 'dq') for name in joints]
    return re.sub(r'X(\d+)', lambda m: signals[int(m[1]) - 1], text)


def _symbolic(train, far):
    """Return what symbolic regression says of one world: findings, and what it leaves far away."""
    from pyoperon.sklearn import SymbolicRegressor  # noqa: PLC0415 - an extra

    names, k = train.motion.tree.moving_names, train.d.shape[1]
    x, x_far = _states(train), _states(far)
    findings, left = {}, np.empty(k)
    for j in range(k):
        scale = np.sqrt((train.d[:, j] ** 2).mean()) + 1e-12
        search = SymbolicRegressor(allowed_symbols=SYMBOLS, max_length=LONGEST,
                                   max_time=BUDGET_S, random_state=SEED)  # fmt: skip
        search.fit(x, train.d[:, j] / scale)
        share = float(((scale * search.predict(x)) ** 2).mean() / train.power[j])
        left[j] = ((far.d[:, j] - scale * search.predict(x_far)) ** 2).mean()
        if share > SHARE:
            text = formula_of(search.get_model_string(search.model_, 9), names)
            findings[names[j]] = {
                'formula': f'tau_x[{names[j]}] = c*({text})', 'share': share, 'terms': 1,
                'parameters': {'c': {'value': float(scale)}},
            }  # fmt: skip
    return findings, left


def _process(train, far):
    """Return what a Gaussian process without names leaves far away, (k,)."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # noqa: PLC0415 - an extra
    from sklearn.gaussian_process.kernels import (  # noqa: PLC0415
        RBF,
        ConstantKernel,
        WhiteKernel,
    )

    x, x_far = _states(train), _states(far)
    size = x.std(axis=0) + 1e-12
    some = np.linspace(0, len(x) - 1, min(len(x), ROWS)).astype(int)
    left = np.empty(train.d.shape[1])
    for j in range(len(left)):
        scale = np.sqrt((train.d[:, j] ** 2).mean()) + 1e-12
        kernel = ConstantKernel(1.0) * RBF(np.ones(x.shape[1])) + WhiteKernel(1e-3, (1e-8, 1.0))
        found = GaussianProcessRegressor(kernel, random_state=SEED)
        found.fit(x[some] / size, train.d[some, j] / scale)
        away = far.d[:, j] - scale * found.predict(x_far / size)
        left[j] = (away**2).mean()
    return left


def score(answer, findings, left, far):
    """Return how one tool did in one world."""
    (effect,) = answer['effects']
    j = list(far.motion.tree.moving_names).index(effect['joint'])
    own = findings.get(effect['joint'])
    error = law_error(effect, own) if own else np.inf
    said = max(findings, key=lambda name: findings[name]['share'], default='')
    return {
        'right_joint': said == effect['joint'], 'terms': own['terms'] if own else 0,
        'law_error': float(error) if np.isfinite(error) else None,
        'found': bool(error <= SAME and len(findings) == 1),
        'wrong': bool(findings) and not (error <= SAME and len(findings) == 1),
        'far': float(left[j] / max((far.d[:, j] ** 2).mean(), 1e-300)),
    }  # fmt: skip


def judged(folder, answer):
    """Return the scores of all tools in one world."""
    robot = load_robot(str(folder / 'robot.urdf'))
    tree = nominal_tree(robot)
    train, far = (equations_of(folder / f'{n}.mcap', robot, tree) for n in ('real', 'real_far'))
    texts, found = library(list(train.motion.tree.moving_names)), {}
    for name, method in (
        ('lasso', lambda *x: _sparse(lasso, texts, *x)),
        ('stlsq', lambda *x: _sparse(stlsq, texts, *x)), ('operon', _symbolic),
    ):  # fmt: skip
        begin = time.process_time()
        findings, left = method(train, far)
        found[name] = score(answer, findings, left, far)
        found[name]['cpu_s'] = round(time.process_time() - begin, 1)
    begin = time.process_time()
    found['process'] = {'far': score(answer, {}, _process(train, far), far)['far']}
    found['process']['cpu_s'] = round(time.process_time() - begin, 1)
    return found


def summary(rows):
    """Return the rates of each tool."""

    def rate(tool, key):
        return float(np.mean([r[tool][key] for r in rows]))

    return {
        tool: {
            **{key: rate(tool, key) for key in ('found', 'right_joint', 'wrong')
               if key in rows[0][tool]},
            'far_median': float(np.median([r[tool]['far'] for r in rows])),
            'far_worse': float(np.mean([r[tool]['far'] > 1.0 for r in rows])),
            'cpu_s': rate(tool, 'cpu_s'),
        }
        for tool in ('lasso', 'stlsq', 'operon', 'process')
    }  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('worlds', type=Path)
    parser.add_argument('--name', default='unlisted_baselines', help='of the file of results')
    arguments = parser.parse_args()
    warnings.simplefilter('ignore')
    rows = []
    for path in sorted((arguments.worlds / 'answers').glob('*.json')):
        answer = json.loads(path.read_text(encoding='utf-8'))
        folder = arguments.worlds / 'cases' / path.stem
        if not (folder / 'real_far.mcap').exists():
            continue
        rows.append({'case': path.stem, **judged(folder, answer)})
        print(json.dumps(rows[-1]), flush=True)
    report = {'terms': 'library of sgp_proof/concealed/baselines.py', 'summary': summary(rows),
              'cases': rows}  # fmt: skip
    write_result(RESULTS / f'{arguments.name}.json', report)
    print(json.dumps(report['summary'], indent=1))


if __name__ == '__main__':
    main()
