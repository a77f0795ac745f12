"""Write docs/connection.md: wrong connections, and machines with their simulations, as measured.

python docs/generate_connection.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
TARGET = ROOT / 'docs' / 'connection.md'
_PAGE = """# Set-up errors and simulations, measured

This page shows how often a diagnosis names an error of the connection, and how often it finds the difference between a machine and
its simulation. Both tests draw robots, motions and errors from a seed, so anyone can repeat them or draw others. The tests are
small: look at the single worlds, not at the percentages. The names are those of [effects](effects.md) and of [set-up errors](check.md).

## Set-up errors

```bash
python -m sgp_proof.connection.run --seeds {setup_seeds}
```

The recording or the robot file of a simulated robot has an error: an encoder zero, a sign, a unit, two swapped joints, efforts of
another scale, a clock offset, a base that is not level, or a joint origin. In some worlds, physics is missing as well. The outcomes
are:

* *Right*: the error, its joint and its channels are named, and each number is right to a tenth of the error.
* *Open*: no wrong error is asserted, but the error was missed or its probability was 0.5 or less.
* *Wrong*: an error is asserted that is not there.

Physics that is asserted in place of an error is not scored here. It is shown in the column *answer*, each name with its
probability.

| | worlds | right | open | wrong |
|---|---|---|---|---|
{setup_summary}

### Not named

| world | robot | error | answer | outcome |
|---|---|---|---|---|
{setup_missed}

### Named

| world | robot | error | answer |
|---|---|---|---|
{setup_right}

## A machine and its simulation

```bash
python -m sgp_proof.connection.simulated --seeds {sim_seeds}
```

This tests `sgp diagnose real.mcap --robot arm.urdf --sim sim.mcap`. Machine and simulation share one or two frictions that the
robot file lacks. They differ in the size of one of them, in an effect that only one has, or in nothing. *Right* means that the
difference is named with its joint and its size (to a tenth, or within three standard deviations), and that nothing else is
asserted. If nothing differs, it means that the verdict says so. Sizes are machine minus simulation, in SI units.

| what differs | worlds | right | missed | wrong |
|---|---|---|---|---|
{sim_summary}

Of {shared} effects that machine and simulation share, {shared_named} are listed as shared.

### Missed or wrong

| world | robot | what differs | answer | outcome |
|---|---|---|---|---|
{sim_missed}

### Right

| world | robot | what differs | answer |
|---|---|---|---|
{sim_right}
"""
_OUTCOMES = {'equivalent': 'open'}
_KINDS = {
    'size': 'the size of an effect', 'machine': 'an effect that only the machine has',
    'simulation': 'an effect that only the simulation has', 'nothing': 'nothing',
}  # fmt: skip


def text() -> str:
    """Return the page."""
    setup, sim = (_read(name) for name in ('connection', 'simulated'))
    missed, right = _apart(setup['cases'], _setup_cells)
    sim_missed, sim_right = _apart(sim['cases'], _sim_cells)
    named, shared = sim['summary']['shared_named']
    return _PAGE.format(
        setup_seeds=setup['seeds'], sim_seeds=sim['seeds'],
        setup_summary='\n'.join(
            _counts(words, setup['summary'][key])
            for key, words in (('with_error', 'with an error'), ('without_error', 'without'))
        ),
        setup_missed=missed, setup_right=right,
        sim_summary='\n'.join(
            _counts(words, sim['summary']['by_kind'][kind])
            for kind, words in _KINDS.items() if kind in sim['summary']['by_kind']
        ),
        shared=shared, shared_named=named, sim_missed=sim_missed, sim_right=sim_right,
    )  # fmt: skip


def _read(name: str) -> dict[str, Any]:
    path = ROOT / 'sgp_proof' / 'results' / f'{name}.json'
    found: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
    return found


def _counts(words: str, outcomes: dict[str, int]) -> str:
    cells = [words, sum(outcomes.values()), *outcomes.values()]
    return f'| {" | ".join(map(str, cells))} |'


def _apart(cases, cells) -> tuple[str, str]:
    """Return the rows of the worlds with another outcome than right, and of the others."""
    missed = [
        [*cells(case), _OUTCOMES.get(case['outcome'], case['outcome'])]
        for case in cases if case['outcome'] != 'right'
    ]  # fmt: skip
    right = [cells(case) for case in cases if case['outcome'] == 'right']
    tables = ['\n'.join(f'| {" | ".join(row)} |' for row in rows) for rows in (missed, right)]
    return tables[0], tables[1]


def _setup_cells(case) -> list[str]:
    errors = [f'{_at(e)} ({_values(e["parameters"])})' for e in case['setup']]
    physics = [f'{effect} of {joint}' for effect, joint in case['physics']]
    concealed = '; '.join(errors) or 'none'
    if physics:
        concealed += f'; and the physics {", ".join(physics)}'
    return [case['case'], case['robot'], concealed, _answer(case, _with_probability)]


def _sim_cells(case) -> list[str]:
    differs = [
        f'{_at(e)} by {next(x for k, x in e.items() if k not in {"effect", "joint"}):.3g}'
        for e in case['differs']
    ]
    return [
        case['case'],
        case['robot'],
        '; '.join(differs) or 'nothing',
        _answer(case, _with_size),
    ]


def _answer(case, worded) -> str:
    if case['said'] == 'refused':
        return f'refused: {case["why"]}'
    verdict, *found = case['said']
    if found and found[0] and isinstance(found[0][0], list):
        (found,) = found
    return ': '.join([f'`{verdict}`', *[', '.join(map(worded, filter(None, found)))] * any(found)])


def _with_probability(found) -> str:
    effect, joint, probability = found
    return f'{effect} of {joint} ({probability:.2f})'


def _with_size(found) -> str:
    effect, joint, (value, std) = found
    return f'{effect} of {joint}' + (
        '' if value is None else f' by {value:.3g} ± {1.96 * std:.2g}'
    )


def _at(entry) -> str:
    return f'{entry["effect"]} of {entry["joint"]}'


def _values(parameters) -> str:
    return ', '.join(
        f'{name} {x}' if isinstance(x, str) else f'{name} {x:.3g}'
        for name, x in parameters.items()
    )


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
