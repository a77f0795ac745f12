"""What a benchmark ran on, to stand beside its numbers."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path

PACKAGES = ('numpy', 'scipy', 'numba')


def environment() -> dict[str, str]:
    """Return processor, cores, Python and package versions."""
    names = [
        line.split(':', 1)[1].strip()
        for line in Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        if line.startswith('model name')
    ]
    found = {
        'processor': names[0] if names else platform.processor(),
        'cores': str(len(names)),
        'system': platform.platform(),
        'python': platform.python_version(),
    }
    return found | {name: version(name) for name in PACKAGES}
