"""Worlds in which a robot is connected wrongly, diagnosed by the command line and scored.

    python -m sgp_proof.connection.run --seeds 0:30 [--outputs DIR]

An answer counts as right where error, joint and channels are named and every number is right to a
tenth of the error; as equivalent where nothing wrong is asserted; else, said with more than .5, as
wrong. Without an error of the connection, right is to assert none. Results go to
`sgp_proof/results/connection.json`.
"""

from __future__ import annotations

from sgp_proof.connection.draw import draw_case
from sgp_proof.connection.seeds import score_seeds

_TOLERANCE = 0.1


def main():
    score_seeds(__doc__, 'connection', draw_case, scored, summary)


def scored(row, diagnosis):
    """Return the answer of one world with its score."""
    if 'refused' in diagnosis:
        row |= {'said': 'refused', 'why': diagnosis['refused'], 'outcome': 'equivalent'}
    else:
        row |= {'said': said(diagnosis), 'outcome': judged(row, diagnosis)}
    print(row['case'], row['robot'], row['setup'], row['physics'], '->', row['said'],
          row['outcome'], f'{row["seconds"]:.0f} s', flush=True)  # fmt: skip
    return row


def said(diagnosis):
    """Return what is asserted."""
    found = [*diagnosis.get('setup', []), *diagnosis['findings']]
    return diagnosis['verdict'], [[f['effect'], f['joint'], f['probability']] for f in found]


def judged(answer, diagnosis):
    """Return `right`, `equivalent` or `wrong`."""
    setup = [f for f in diagnosis.get('setup', []) if f['probability'] > 0.5]
    wanted = answer['setup']
    if len(setup) == len(wanted) and all(any(is_same(w, f) for f in setup) for w in wanted):
        return 'right'
    rest = [f for f in setup if not any(is_same(w, f) for w in wanted)]
    return 'wrong' if rest else 'equivalent'


def is_same(wanted, found):
    """Return whether an error is named with its joint, channels and numbers."""
    if (wanted['effect'], wanted['joint']) != (found['effect'], found['joint']):
        return False
    for name, true in wanted['parameters'].items():
        value = found['parameters'].get(name, {}).get('value')
        if isinstance(true, str):
            if value != true:
                return False
            continue
        neutral = 1.0 if name == 'scale' else 0.0
        if value is None or abs(value - true) > _TOLERANCE * abs(true - neutral) + 0.01:
            return False
    return True


def summary(rows):
    """Return the shares of the outcomes, with and without an error of the connection."""
    with_error = [r for r in rows if r['setup']]
    without = [r for r in rows if not r['setup']]
    share = lambda group, outcome: sum(r['outcome'] == outcome for r in group)  # noqa: E731
    return {
        'worlds': len(rows),
        'with_error': {k: share(with_error, k) for k in ('right', 'equivalent', 'wrong')},
        'without_error': {k: share(without, k) for k in ('right', 'equivalent', 'wrong')},
    }


if __name__ == '__main__':
    main()
