"""One BLAS thread, profiles of Hypothesis, and what is left out where Pinocchio is not at hand."""

from __future__ import annotations

import os
from importlib.util import find_spec

# As the commands do, before NumPy loads: the small matrices here are slower with more threads.
for _name in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

from hypothesis import settings  # noqa: E402 - the environment above comes first

settings.register_profile('dev', deadline=None)
settings.register_profile('ci', deadline=None, derandomize=True)
settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'dev'))

collect_ignore = (
    []
    if find_spec('pinocchio')
    else [
        f'{folder}/test_{name}.py'
        for folder, names in {
            'contracts': ('robots',),
            'offline': ('excitation', 'suggestions', 'real_arms'),
            'robots': (
                'inertial', 'pendulums', 'ready_robots', 'rigid_body', 'tree', 'urdf_robot',
                'urdf_writer',
            ),
            'simulation': ('random_tree', 'serial_arm'),
        }.items()
        for name in names
    ]
)  # fmt: skip
"""No wheel of Pinocchio 3 goes with NumPy 1.26, the oldest that is tested."""
