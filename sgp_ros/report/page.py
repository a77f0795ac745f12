"""Pages in one file: text, styles, charts as data, and the script that draws them.

A page opens from disk and makes no request. Without scripts, and on paper, the same
figures stand there as pictures.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from sgp_ros.report.charts import THINNED, Chart, embedded_data

_ASSETS = 'assets'


def render_page(
    template: str, charts: Mapping[str, Chart], figures: Mapping[str, bytes], **values: Any
) -> str:
    """Return a page as HTML; every text in it is escaped.

    Args:
        template: its name.
        charts: by the names that the template asks for.
        figures: PNG by stem, for print and for readers without scripts.
        values: what else the template asks for.
    """
    environment = Environment(
        loader=PackageLoader('sgp_ros.report'), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters['typeset'] = typeset
    return environment.get_template(template).render(
        charts=charts,
        chart_data=Markup(embedded_data(charts)),  # noqa: S704 - JSON without any <
        figures={
            name: 'data:image/png;base64,' + base64.b64encode(content).decode()
            for name, content in figures.items()
        },
        thinned=THINNED if charts else '',
        styles=Markup(_asset('uPlot.min.css') + _asset('robot.css') + _asset('report.css')),  # noqa: S704 - our own
        scripts=Markup(_asset('uPlot.iife.min.js') + _asset('report.js')),  # noqa: S704 - as above
        **values,
    )


_SIGNS = {
    '+-': '±', ' -> ': ' → ', ' N m': '\u00a0N\u00a0m', '^2': '²', '^3': '³', '(rad)²': 'rad²',
    '(rad)³': 'rad³', '(m)²': 'm²', '(m)³': 'm³',
}  # fmt: skip


_POWER = re.compile(r'((?:(?<=kg )|(?<=m )|(?<=m\u00a0)|(?<=N )|(?<=/))(?:m|s|rad))([23])\b')
"""A unit with a power, behind another unit; a joint may be called m2."""


_EXPONENT = re.compile(r'\b(\d+(?:\.\d+)?)e([+-])0*(\d+)\b')
_RAISED = str.maketrans('0123456789', '⁰¹²³⁴⁵⁶⁷⁸⁹')


def typeset(text: str) -> str:
    """Return text with the signs that a terminal may lack; no number breaks at its exponent."""
    text = _EXPONENT.sub(_power_of_ten, text)
    for plain, sign in _SIGNS.items():
        text = text.replace(plain, sign)
    return _POWER.sub(lambda found: found[1] + '²³'[int(found[2]) - 2], text)


def _power_of_ten(number: re.Match[str]) -> str:
    if number[2] == '+' and len(number[3]) == 1:
        return f'{float(number[0]):.0f}'
    return f'{number[1]}·10{"⁻" * (number[2] == "-")}{number[3].translate(_RAISED)}'


def robot_styles() -> str:
    """Return the styles of a picture of a robot, for pages of other programs."""
    return f'<style>{_asset("robot.css")}</style>'


def _asset(name: str) -> str:
    return (files('sgp_ros.report') / _ASSETS / name).read_text(encoding='utf-8')
