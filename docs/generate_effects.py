"""Write docs/effects.md: every effect of the catalogue, as its law says of itself.

python docs/effect_pictures.py && python docs/generate_effects.py
"""

from __future__ import annotations

from pathlib import Path

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.grammar import FUNCTIONS
from sgp_ros.physics.parts import LAST

TARGET = Path(__file__).parent / 'effects.md'
PICTURES = Path(__file__).parent / 'images' / 'effects'
_HEAD = """# Effects

The {count} effects that a robot may have beside its rigid bodies. `sgp diagnose` names them, a robot YAML
states them under `effects`, `sgp simulate` can add them. This page is written by `docs/generate_effects.py` from
the catalogue in `sgp_ros/physics`.

Signs are those of a generalised force: `M a + h = tau + tau_x`, so friction has positive numbers. `q`, `v` and
`a` are position, velocity and acceleration of the joint. Units are those of a revolute joint; on a prismatic
one read N for N m and m for rad. Kinds named `viscous` have levels in N m s/rad.

Each picture shows the force along one swing of an arm of two joints, over the variable that the report draws it
over; its numbers are an example.

## Laws of your own
A force that no effect describes is stated as a formula in the robot YAML:

```yaml
effects:
  - law:
      joint: elbow
      words: an eddy-current brake
      formula: -a*dq[elbow]/(1 + (dq[elbow]/v0)**2)
      parameters:
        a: {{start: 0.5, unit: N m s/rad, range: [0, 10]}}
        v0: {{start: 2.0, unit: rad/s, range: [0.2, 20]}}
```

- `formula` is the force `tau_x` on the joint, of `q[J]`, `dq[J]`, `ddq[J]`, `tau[J]` of any joint, the time `t`,
  numbers and parameters, with `+ - * / **`, {functions}.
  `lag(x, T)`, `play(x, width)` and `delay(x, T)` have a memory. Names with other signs than letters, digits and _ are quoted:
  `q["arm-1"]`.
- A parameter with `start` is estimated: `sgp diagnose` tries the law beside all effects, within `range`, and names it
  only where it earns its price. With `value` for all parameters, and optionally `std`, the law is part of the robot. A
  `value` beside parameters with `start` is a constant.
- Units are checked: angles have none, and a constant that has one needs a name (`tanh(dq[elbow]/v0)`, not `/0.05`). `sgp effects
  --robot ROBOT` lists what a robot states.
- A found law stands in `diagnosis.json` with `"effect": "law"` and its formula, and in `robot_diagnosed.yaml` with its
  values, for replay, node and simulation.
- Not online are laws of the time, with memory, or of an effort together with a position. Not simulated are `ddq`,
  which is the effect `armature`, and `delay`. With `sign(dq[J])` that opposes its own motion a law holds the joint at
  rest, as dry friction does.
"""
_OVER = {
    'seconds': 'time, a few seconds of it', 'time': 'time, its magnitude',
}  # fmt: skip


def text() -> str:
    """Return the page."""
    functions = ', '.join(f'`{name}`' for name in FUNCTIONS)
    parts = [_HEAD.format(count=len(EFFECTS), functions=functions)]
    parts += [_section(law) for law in EFFECTS.values()]
    return '\n'.join(parts)


def _section(law) -> str:
    lines = [
        f'## `{law.name}`',
        '',
        f'{law.words[0].upper()}{law.words[1:]}: `{law.formula}`.',
        '',
    ]
    if (PICTURES / f'{law.name}.svg').exists():
        over = _OVER.get(law.drawn_over, law.drawn_over)
        said = f'Force of {law.words} over {over}, on an arm that swings'
        lines += [f'![{said}](images/effects/{law.name}.svg)', '']
    lines += ['| parameter | unit | |', '|---|---|---|']
    lines += [f'| `{q.name}` | {q.unit} | {_said(q)} |' for q in law.quantities]
    lines += [
        '', f'- In data: {law.appearance}.', f'- Place: {_place(law)}.',
        f'- Source: {law.source}.',
    ]  # fmt: skip
    if law.kinds:
        lines.append(f'- Kinds: {", ".join(law.kinds)}.')
    if law.term is not None:
        sign = 'the same sign' if law.term.sign > 0.0 else 'the other sign'
        names = ', '.join(f'`{name}`' for name in law.term.names)
        lines.append(f'- Term `{law.term.name}` of a robot YAML: coefficients {names}, {sign}.')
    if not law.is_online:
        lines.append('- Not modelled online: it depends on more than one time.')
    return '\n'.join([*lines, ''])


def _said(q) -> str:
    said = ['positive'] if q.is_positive else ['at least 0'] if q.low >= 0.0 else []
    said += [f'of kind {q.kinds[0]}'] if q.kinds else []
    said += ['may be left out'] if q.is_optional else []
    return ', '.join(said)


def _place(law) -> str:
    text = 'the last joint' if law.site is LAST else law.site.value
    text += ', or `all`' if law.takes_all else ''
    text += ' with limits' if law.needs_limits else ''
    text += ', at one end of its range (`side`)' if law.edge else ''
    return text + (', and a `source_joint`' if law.has_source else '')


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
