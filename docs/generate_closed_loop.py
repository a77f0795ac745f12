"""Write docs/closed_loop.md: concealed logs of position control, from the committed result.

python docs/generate_closed_loop.py
"""

from __future__ import annotations

import json
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = ROOT / 'docs' / 'closed_loop.md'
_HEAD = """# Logs of position control without efforts

```bash
python -m sgp_proof.connection.closed --seeds {seeds}
```
Driven robots follow smooth targets under proportional and derivative gains, at 50 to 500 Hz; the log holds positions,
mostly velocities, and targets, and no effort. Each world conceals one or two of: gains other than stated, a delay of the target,
rotor inertia, dry friction; or nothing. The truth moves in MuJoCo. A component is named where effect and joint are right
and every number is to 15 % or within three standard deviations.

Of {count} components in {with_hidden} worlds, **{named} are named**; everything is right in {all_named} of these worlds;
{spurious} of {worlds} worlds have something asserted that is not there. The number of worlds is small: the page says what was
measured, and no more. The aim, nine of ten components, is missed.

| component | named |
|---|---|
"""
_TAIL = """
## World by world

| world | robot, rate | concealed | said | named |
|---|---|---|---|---|
{rows}

## What goes wrong
* **Gains and something else at one joint.** Where the log has no target of the velocity, `kd` other than stated is viscous
  friction: the two are one law, and the tool answers with the second. Gains other than stated beside a delay end
  unexplained: the search for errors of the connection sees the recording as it is, with the delay in it.
* **Rotors.** One is found too small by more than its interval says, and one is missed beside a delay.
* **Nothing concealed** gives `parameters_only` with hardly any wrong parameter; no effect is asserted.
"""


def text() -> str:
    """Return the page."""
    path = ROOT / 'sgp_proof' / 'results' / 'closed_loop.json'
    found = json.loads(path.read_text(encoding='utf-8'))
    s = found['summary']
    named, count = s['components_named']
    head = _HEAD.format(
        seeds=found['seeds'], count=count, named=named, with_hidden=s['with_hidden'],
        all_named=s['all_named'], spurious=s['worlds_with_spurious'], worlds=s['worlds'],
    )  # fmt: skip
    effects = [f'| {effect} | {n} of {m} |' for effect, (n, m) in s['by_effect'].items()]
    rows = '\n'.join(_row(case) for case in found['cases'])
    return head + '\n'.join(effects) + '\n' + _TAIL.format(rows=rows)


def _row(case) -> str:
    hidden = ', '.join(f'{h["effect"]} of {h["joint"]}' for h in case['hidden']) or 'nothing'
    verdict, *effects = case['said'] if isinstance(case['said'], list) else [case['said']]
    said = ', '.join(f'{effect} of {joint}' for effect, joint in effects)
    named = f'{sum(case["named"])} of {len(case["named"])}'
    return (
        f'| {case["case"]} | {case["family"]}, {case["rate_hz"]:g} Hz | {hidden} | {verdict}'
        f'{": " if said else ""}{said} | {named} |'
    )


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
