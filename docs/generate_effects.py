"""Write docs/effects.md: every effect of the catalogue, as its law says of itself.

python docs/generate_effects.py
"""

from __future__ import annotations

from pathlib import Path

from sgp_ros.physics.catalogue import EFFECTS
from sgp_ros.physics.parts import LAST

TARGET = Path(__file__).parent / 'effects.md'
_HEAD = """# Effects

The {count} effects that a robot may have beside its rigid bodies. `sgp diagnose` names them, a robot YAML
states them under `effects`, `sgp simulate` has them. This page is written by `docs/generate_effects.py` from
the catalogue in `sgp_ros/physics`.

Signs are those of a generalised force: `M a + h = tau + tau_x`, so friction has positive numbers. `q`, `v` and
`a` are position, velocity and acceleration of the joint. Units are those of a revolute joint; on a prismatic
one read N for N m and m for rad. Kinds named `viscous` have levels in N m s/rad.
"""
_OVER = {
    'seconds': 'time, a few seconds of it', 'time': 'time, its magnitude',
}  # fmt: skip


def text() -> str:
    """Return the page."""
    parts = [_HEAD.format(count=len(EFFECTS))]
    parts += [_section(law) for law in EFFECTS.values()]
    return '\n'.join(parts)


def _section(law) -> str:
    lines = [
        f'## `{law.name}`',
        '',
        f'{law.words[0].upper()}{law.words[1:]}: `{law.formula}`.',
        '',
    ]
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
    if law.is_force:
        over = _OVER.get(law.drawn_over, law.drawn_over)
        lines.append(f'- The report draws its force over {over}.')
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
