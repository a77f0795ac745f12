"""What a benchmark ran on, to stand beside its numbers."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ('numpy', 'scipy', 'numba', 'torch', 'gpytorch', 'scikit-learn')


def machine() -> dict[str, str]:
    """Return processor, cores, system and the versions of what was timed and is installed."""
    processor = Path('/proc/cpuinfo')
    lines = processor.read_text(encoding='utf-8').splitlines() if processor.exists() else []
    names = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
    found = {
        'processor': names[0] if names else platform.processor(),
        'cores': str(len(names)),
        'system': platform.platform(),
        'python': platform.python_version(),
    }
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
