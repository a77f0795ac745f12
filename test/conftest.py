"""One BLAS thread, profiles of Hypothesis, and what is left out where a library is not at hand."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from types import CodeType
from typing import Any

# As the commands do, before NumPy loads: the small matrices here are slower with more threads.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

import pytest  # noqa: E402 - the environment above comes first
from hypothesis import settings  # noqa: E402 - the environment above comes first

settings.register_profile('dev', deadline=None)
settings.register_profile('ci', deadline=None, derandomize=True)
settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'dev'))


if 'SLIPCOVER_ENABLED' in os.environ:  # by `make test MEASURE=1`
    import numba

    def _without_probes(function: Any) -> Any:
        """Return `function` with the code of its source: Numba cannot compile probes."""
        made = function.__code__
        source = Path(made.co_filename).read_bytes()
        parts = [compile(source, made.co_filename, 'exec', dont_inherit=True)]
        for code in parts:  # grows
            if (code.co_name, code.co_firstlineno) == (made.co_name, made.co_firstlineno):
                function.__code__ = code
            parts += [part for part in code.co_consts if isinstance(part, CodeType)]
        return function

    def _njit(*function: Any, _njit: Any = numba.njit, **options: Any) -> Any:
        decorate = _njit(**options)
        return (
            decorate(_without_probes(*function))
            if function
            else lambda f: decorate(_without_probes(f))
        )

    numba.njit = _njit


@pytest.fixture(autouse=True)
def _bugs_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have an engine and a command raise what they would count, or say, in the field."""
    monkeypatch.setenv('SGP_DEBUG', '1')
    monkeypatch.setattr('sgp_ros.engine.engine.RAISES_FAILURES', True)


_MISSING = tuple(name for name in ('pinocchio', 'mujoco') if find_spec(name) is None)
"""No wheel of Pinocchio 3 goes with NumPy 1.26, the oldest that is tested; MuJoCo is optional."""


def _missing(error: BaseException | None) -> str:
    """Return the library that is not at hand and whose import raised `error`, or nothing."""
    while error is not None:
        if isinstance(error, ModuleNotFoundError) and error.name in _MISSING:
            return f'no {error.name}'
        error = error.__cause__ or error.__context__
    return ''


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[Any]:
    """Leave out a file that imports what is not at hand."""
    report = yield
    found = report.call.excinfo
    reason = _missing(found.value) if found else ''
    if reason:
        report.outcome, report.longrepr = 'skipped', (str(collector.path), 0, reason)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[Any]:
    """Leave out a test that comes upon what is not at hand."""
    report = yield
    reason = _missing(call.excinfo.value) if call.excinfo else ''
    if reason:
        report.outcome, report.longrepr = 'skipped', (str(item.path), 0, reason)
    return report
