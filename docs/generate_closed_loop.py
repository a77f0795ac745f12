"""Write docs/closed_loop.md: concealed logs of position control, from the committed result.

python docs/generate_closed_loop.py
"""

from __future__ import annotations

import json
from pathlib import Path

from scipy import stats

ROOT = Path(__file__).parents[1]
TARGET = ROOT / 'docs' / 'closed_loop.md'
_HEAD = """# Logs of position control without efforts

Many robots log only positions and the targets of their position drives, but no efforts. `sgp diagnose` with `--gains` also works on
such logs. This page shows how often it names what is wrong in simulated logs with known answers, and where it fails.

```bash
python -m sgp_proof.connection.closed --seeds {seeds}
```

Simulated robots follow smooth targets under proportional and derivative gains, at 50 to 500 Hz. The log holds positions,
mostly velocities, and targets, but no effort. Each world (simulated robot) has one or two of these components, or none: gains other
than stated, a delay of the target, rotor inertia, dry friction. An effect that makes up less than 0.4 % of an effort is drawn
again. The truth is simulated in MuJoCo, whose own drives act within the stages of the Runge-Kutta method. A component counts as named if
effect and joint are right and every number is right to 15 % or within three standard deviations.

Of {count} components in {with_hidden} worlds, **{named} are named**. Everything is right in {all_named} of these worlds. In
{spurious} of {worlds} worlds, something is asserted that is not there. The target, nine of ten components, is {aim}: the 95 %
interval (Clopper and Pearson) reaches from {low} % to {high} %. None of these worlds was looked at before. Misses of earlier versions were found
and corrected on worlds 0 to 21, 1000 to 1087, where 102 of 120 components had been named, and 1088 to 1123, where 44 of 48 had been.

| component | named |
|---|---|
"""
_TAIL = """
## World by world

| world | robot, rate | hidden | answer | named |
|---|---|---|---|---|
{rows}

## Limits, and how such logs are treated
* **Gains and a delay.** As long as the targets are delayed, the gains of every drive look wrong. So the search for set-up errors
  begins with the delay if that gains more than its penalty; the delay is kept and named as physics. Wrong gains hide a delay, too, so
  it is also searched together with gains that were found without it. The comparison of physics also
  starts from the delay together with what every joint has, because a late target looks like viscous friction and rotors at all
  joints.
* **Gains and bodies.** Where no effort is measured, doubling both gains and bodies does not change the motion. Gains are therefore
  first searched with the bodies of the robot file, together with rotors and dry friction. It may be that other bodies alone
  leave nothing that counts as physics, and that a search with free bodies finds no error. Then both explanations are given, with a
  certainty of one half, and either a gain or a mass must be measured.
* **Gains and a delay in slow motion.** A delay that is shorter by d, with `kd'/kp' = kd/kp + d` and
  `kp' = M/(M/kp + d kd/kp + d^2/2)`, gives the same motion to second order, so motion much slower than the loop hardly
  distinguishes the two. All numbers are searched at once, with and without each error, and each interval allows for the uncertainty of
  all others, so the intervals are wide in such motion. The prior for stated gains is a factor of e^0.5.
* **A single joint** whose gains, rotor and friction are all unknown moves alike if all grow together. Gains beside dry friction of a single
  slide or pendulum are therefore often told as viscous friction and other bodies, or a rotor (worlds 1003, 1027, 1039, 1053 and 1087).
* **kd and viscous friction** are the same law if the log has no velocity target. If `kp` is as stated, the answer is viscous
  friction; if not, the gains of the drive. A motor with a wrong torque constant is named as wrong gains, with or without viscous
  friction beside it; that physics is said to fit equally well.
* **Held targets at 50 Hz.** A target that jumps every h excites a stiff drive between the samples. Samples at the rate of the
  targets always see this ripple at the same phase, where it looks like a target that is later or earlier by some hundredths of h.
  The ripple can be computed from gains and bodies. It is subtracted (`physics/ripple.py`) where one recording has targets and states at
  the same rate, and a motor at every joint. Two worlds at 50 Hz with nothing hidden (500 and 503) were reported as `unexplained` and
  `missing_physics` before, and are reported as `no_mismatch` now. Rotors that are missing in the robot file change the ripple: where some are found, everything is compared again with
  them. Targets that the drive interpolates have no such ripple; this is
  not recognised.
* **Drives with a slow clock.** A drive that computes once per step of h, and not continuously, acts h/2 late. Viscous friction is then
  estimated too small by about kp h/2, and a rotor by kd h. With stiff gains and h of 0.25 ms, that was a sixth of a rotor in
  earlier worlds.
"""


def text() -> str:
    """Return the page."""
    path = ROOT / 'sgp_proof' / 'results' / 'closed_loop.json'
    found = json.loads(path.read_text(encoding='utf-8'))
    s = found['summary']
    named, count = s['components_named']
    low = stats.beta.ppf(0.025, named, count - named + 1) if named else 0.0
    high = stats.beta.ppf(0.975, named + 1, count - named) if named < count else 1.0
    head = _HEAD.format(
        aim='met' if low >= 0.9 else 'not proved', low=round(100 * low),
        high=round(100 * high), seeds=found['seeds'], count=count, named=named, with_hidden=s['with_hidden'],
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
