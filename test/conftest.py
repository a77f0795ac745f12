"""One BLAS thread, profiles of Hypothesis, and what is left out where a library is not at hand."""

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

_NEEDED = {
    'pinocchio': {
        'contracts': ('robots',),
        'batch': ('excitation', 'identification', 'real_arms', 'suggestions'),
        'physics': ('effects', 'stated'),
        'rigid': ('inertial', 'rigid_body', 'tree', 'urdf_writer'),
        'robots': (
            'effect_terms', 'pendulums', 'built_in_nominal', 'lumped', 'ready_robots',
            'urdf_robot',
        ),
        'simulation': ('tree', 'tree_part'),
        'proof/numerics': ('random_tree', 'trees'),
        'proof/paper': ('serial_arm',),
    },
    'mujoco': {
        'apps': ('built_in_diagnosis', 'shipped_robots', 'simulation', 'stated_simulation'),
        'robots': ('lumped',),
        'proof/concealed': ('concealed',),
        'simulation': ('effect_laws', 'tree', 'tree_part'),
    },
}  # fmt: skip
"""No wheel of Pinocchio 3 goes with NumPy 1.26, the oldest that is tested; MuJoCo is optional."""

collect_ignore = [
    f'{folder}/{name}.py' if '/' in name else f'{folder}/test_{name}.py'
    for library, folders in _NEEDED.items()
    if not find_spec(library)
    for folder, names in folders.items()
    for name in names
]
