"""Online identification of robots, and diagnosis of the physics that their models lack.

    >>> import sgp_ros as sgp
    >>> d = sgp.diagnose('real.mcap', robot='arm.urdf', sim='sim.mcap')  # doctest: +SKIP
    >>> d.findings, d.plot()  # doctest: +SKIP

The names of `sgp_ros.apps.api` are loaded when they are first used.
"""

from __future__ import annotations

__version__ = '0.1.0'

_OFFERED = ('diagnose', 'identify', 'load_robot', 'open_recording', 'simulate')


def __getattr__(name: str) -> object:
    """Return what `sgp_ros.apps.api` offers under a name."""
    if name in _OFFERED:
        from importlib import import_module  # noqa: PLC0415 - the command line starts without

        return getattr(import_module('sgp_ros.apps.api'), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted([*globals(), *_OFFERED])
