"""The texts of all formulas that are tried for a smooth force, from a small grammar.

A term is a shape in one variable X, from `PLACED`, `OF_WAVE`, `OF_VELOCITY` or a product of two of
`FACTORS`. A text is one term with its coefficient, or two, and a constant where this says more:

    a*tanh((X - x0)/w0) + b*X + d

The first letter of a parameter says what it is: a to d coefficients, x a place, w a width, v a
speed, n a wave number, p a power, o and u poles over and under what was seen, e a ratio below
one, r the size of what was seen.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator

COEFFICIENTS = ('a', 'b', 'c', 'd')
"""Parameters that are factors."""
POLYNOMIALS = ('X', 'X**2', 'X**3', 'abs(X)*X')
_U = '((X - x0)/w0)'
_WAVE = 'sin(n0*(X - x0))'
PLACED = (
    'abs(X)', 'abs(X - x0)', '(X - x0)**2', '(X - x0)**3', 'abs(X - x0)*(X - x0)',
    '(abs(X - x0)/r)**p0*sign(X - x0)', '((o0 - X)/r)**(-p0)', '((X - u0)/r)**(-p0)',
    'max(X - x0, 0)', 'max(x0 - X, 0)', 'max(X - x0, 0)**2', 'max(x0 - X, 0)**2',
    '(max(X - x0, 0)/r)**p0', '(max(x0 - X, 0)/r)**p0', 'max(abs(X - x0) - w0, 0)*sign(X - x0)',
    'max(abs(X - x0) - w0, 0)', 'max(abs(X - x0) - w0, 0)**2',
    'max(abs(X - x0) - w0, 0)**2*sign(X - x0)',
    'tanh((X - x0)/w0)', 'exp(X/w0)', 'exp(-X/w0)', f'exp(-{_U}**2)', f'1/(1 + {_U}**2)',
    f'(X - x0)*exp(-{_U}**2)', f'(X - x0)/(1 + {_U}**2)', f'(X - x0)/(1 + {_U}**2)**2',
    f'max(1 - {_U}**2, 0)', 'max(1 - abs(X - x0)/w0, 0)', 'min(max((X - x0)/w0, -1), 1)',
    'min(max((X - x0)/w0, 0), 1)', 'min(max((x0 - X)/w0, 0), 1)',
    'min(max(w0 - abs(X - x0), 0)/w2, 1)', '(((o0 - X)/r)**(-p0) - ((X - u0)/r)**(-p0))',
    f'(1 + {_U}**2)**(-p0)', f'(X - x0)*(1 + {_U}**2)**(-p0)', f'sqrt(1 + {_U}**2)',
    f'(X - x0)/sqrt(1 + {_U}**2)', '(X - x0)/(1 + abs(X - x0)/w0)', 'log(1 + exp((X - x0)/w0))',
    'max(X - x0, 0)*exp(-(X - x0)/w0)', 'max(x0 - X, 0)*exp((X - x0)/w0)',
)  # fmt: skip
"""Terms of any variable, with a place of their own."""
OF_WAVE = (
    'S', 'a*sin(n0*X) + b*cos(n0*X)', 'a*S + b*sin(2*n0*(X - x0))', 'max(S, 0)', 'abs(S)',
    'S**2', 'abs(S)*S', 'S**3', 'max(S - e0, 0)', 'tanh(p0*S)', 'min(max(p0*S, -1), 1)',
    'S*exp(p0*C)', 'S/(1 + e0*C)', 'S/sqrt(1 + e0*C)', 'S*(1 + e0*C)**(-p0)',
    'a*S + b*S/sqrt(1 + e0*C)', '1/(1 + e0*C)', '(1 + e0*C)**(-p0)',
    'sin(n0*(X - x0)*(1 + e0*X/r))', 'sin(n0*min(max(X - x0, -3.14159/n0), 3.14159/n0))',
)  # fmt: skip
"""Terms of a wave S over a position, and C a quarter of a turn ahead; those with coefficients of
their own are whole sums."""
OF_POSITION = (
    *POLYNOMIALS, *PLACED,
    *(term.replace('S', _WAVE).replace('C', 'cos(n0*(X - x0))') for term in OF_WAVE),
)  # fmt: skip
"""Terms of a position."""
OF_VELOCITY = (
    'X', 'abs(X)*X', 'X**3', '(abs(X)/r)**p0*sign(X)', 'X/(1 + (X/v0)**2)', 'X/(1 + abs(X)/v0)',
    'X*(1 + (X/v0)**2)**(-p0)', 'log(abs(X)/v0 + sqrt(1 + (X/v0)**2))*sign(X)',
    'max(X**2 - v0**2, 0)*sign(X)', 'min(max(X, -v0), v0)', 'X/sqrt(1 + (X/v0)**2)',
    'tanh(X/v0)', 'log(1 + abs(X)/v0)*sign(X)', 'X*exp(-abs(X)/v0)', 'X*exp(-(X/v0)**2)',
    'max(abs(X) - v0, 0)*sign(X)', 'max(abs(X) - v0, 0)**2*sign(X)',
    '(exp(abs(X)/v0) - 1)*sign(X)', 'X**2', 'max(X, 0)', 'min(X, 0)', 'max(X, 0)**2',
    'min(X, 0)**2', 'a*max(X, 0)**2 + b*min(X, 0)**2', 'exp(X/v0)', 'exp(-X/v0)',
    'tanh((X - x0)/w0)', 'max(X - x0, 0)', 'max(x0 - X, 0)', 'X**2/(1 + (X/v0)**2)',
    'max(tanh(X/v0), 0)', 'min(tanh(X/v0), 0)', 'X*tanh((abs(X) - v0)/w0)',
    'a*abs(X)*X + b*abs(X)*X*tanh((abs(X) - v0)/w0)',
)  # fmt: skip
"""Terms of a velocity that begin at rest, or act as those do."""
OF_SPEED = ('abs(X)', '(abs(X)/r)**p0', 'tanh(abs(X)/v0)', 'exp(-abs(X)/v0)', 'exp(-(X/v0)**2)',
            'log(1 + abs(X)/v0)', 'max(abs(X) - v0, 0)', 'max(1 - abs(X)/v0, 0)',
            'max(1 - (X/v0)**2, 0)', 'tanh((abs(X) - v0)/w0)')  # fmt: skip
"""Terms of a velocity, whichever its direction."""
OF_FRICTION = (
    'sign(X)', 'exp(-abs(X)/v0)*sign(X)', 'exp(-(X/v0)**2)*sign(X)', 'sign(X)/(1 + abs(X)/v0)',
    'sqrt(abs(X))*sign(X)', 'tanh((abs(X) - v0)/w0)*sign(X)', 'max(1 - abs(X)/v0, 0)*sign(X)',
    'max(1 - (X/v0)**2, 0)*sign(X)',
)  # fmt: skip
"""Terms of the joint's own velocity that jump, or nearly so, at rest."""
FACTORS = ('X', 'X**2', 'exp(X/w0)', 'exp(-X/w0)', 'tanh((X - x0)/w0)', f'exp(-{_U}**2)',
           'sin(n0*(X - x0))', f'1/(1 + {_U}**2)')  # fmt: skip
_OWN = re.compile(r'\b([xwvnpoue])([02])\b')


def of_position() -> Iterator[str]:
    """Yield texts in a position."""
    products = [
        f'{x}*{_second(y)}'
        for x, y in itertools.combinations(FACTORS, 2)
        if x[:3] != 'exp' or y != 'exp(-X/w0)'
    ]
    for term in (*OF_POSITION, *products):
        yield from _with_constant(_sum(term))
    for term in (*OF_POSITION, *products):
        if term not in POLYNOMIALS and 'a*' not in term:
            yield from _with_constant(f'a*X + b*{term}')
    yield 'a*X + b*X**2'
    yield 'a*X + b*X**3'


def of_velocity(*, is_own: bool) -> Iterator[str]:
    """Yield texts in a velocity; of a joint's own those with dry friction too."""
    terms = (*OF_VELOCITY, *OF_SPEED, *(OF_FRICTION if is_own else ()))
    for term in terms:
        plain = [_sum(term)] if term == 'X' or 'a*' in term else [_sum(term), f'a*X + b*{term}']
        for text in plain:
            yield from _with_constant(text)
            if is_own and term != 'sign(X)':
                yield f'{text} + d*sign(X)'
    for term in PLACED:
        yield from _with_constant(f'a*{term}')


def sums(term: str, *, is_position: bool) -> Iterator[str]:
    """Yield texts of a term, such as `a*X**2`, and a second one."""
    for other in OF_POSITION if is_position else dict.fromkeys((*PLACED, *OF_VELOCITY)):
        if 'a*' not in other and other != term.removeprefix('a*'):
            yield f'{term} + b*{_second(other)}'


def smoothed(text: str) -> str:
    """Return a text in which signs of velocities change smoothly."""
    return text.replace('sign(X)', 'tanh(X/v_s)')


def _sum(term: str) -> str:
    return term if 'a*' in term else f'a*{term}'


def _with_constant(text: str) -> Iterator[str]:
    yield text
    yield f'{text} + d'


def _second(term: str) -> str:
    """Return a term whose parameters are not those of the first."""
    return _OWN.sub(lambda m: f'{m[1]}{int(m[2]) + 1}', term)
