"""Install `sgp_ros` with pip or colcon (ament_python)."""

import os
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = 'sgp_ros'
PROOF = 'sgp_proof'
VERSION = '0.1.0'
# `colcon build --symlink-install` runs a link to this file in a folder that lacks the rest.
SOURCES = Path(__file__).resolve().parent


def shared_files():
    """Return the files under `share/sgp_ros`, folder by folder."""
    folders = {'': ['package.xml']}
    for pattern in ('launch/*.py', 'config/**/*', 'bags/**/*'):
        for name in sorted(filter(os.path.isfile, glob(pattern, recursive=True))):
            folders.setdefault(os.path.dirname(name), []).append(name)
    return [(f'share/{NAME}/{folder}'.rstrip('/'), names) for folder, names in folders.items()]


setup(
    name=NAME,
    version=VERSION,
    description='Online robot identification with semi-parametric Gaussian processes',
    long_description=(SOURCES / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    license_files=['LICENSE'],
    maintainer='The sgp_ros maintainers',
    maintainer_email='maintainers@sgp-ros.example',
    python_requires='>=3.10',
    packages=find_packages(include=[NAME, f'{NAME}.*', PROOF, f'{PROOF}.*']),
    package_data={NAME: ['py.typed', 'report/templates/*', 'report/assets/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        *shared_files(),
    ],
    install_requires=[
        'numpy>=1.26',
        'scipy>=1.11',
        'numba>=0.59',
        'clarabel>=0.11',
        'pyyaml>=6',
        'jinja2>=3',
        'matplotlib>=3.6',
        'mcap>=1.6',
        'rosbags>=0.11',
        'zstandard>=0.22',
        'lz4>=4.0',
        'pin>=3',
    ],
    extras_require={
        # rclpy from PyPI for machines without ROS; apt users have it already.
        'wheels': ['ros-rclpy[fastrtps]==7.1.6', 'ros-jazzy-common-interfaces==5.3.6'],
        # Names and options by the Tab key: eval "$(register-python-argcomplete sgp)".
        'completion': ['argcomplete>=3'],
        # The dynamics of URDF robots in `sgp simulate`.
        'simulate': ['mujoco>=3.2'],
        # xacro files; MJCF needs MuJoCo.
        'models': ['xacro>=2', 'mujoco>=3.2'],
        # Parquet and HDF5 files in `sgp import`.
        'tables': ['pyarrow>=14', 'h5py>=3'],
        # The dashboard of `sgp watch`.
        'watch': ['rich>=13'],
        # The file for the viewer Rerun of `sgp diagnose --rerun`.
        'rerun': ['rerun-sdk>=0.41'],
        # Many recordings on many processes, and their results as one table: `sgp campaign`.
        'campaign': ['distributed>=2024.5', 'pyarrow>=14'],
        # The rivals of `sgp bench`.
        'bench': [
            'scikit-learn>=1.4',
            'torch>=2',
            'gpytorch>=1.11',
            'mujoco[sysid]>=4',
            'pysindy>=2',
            'pyoperon>=0.6',
        ],
        'test': [
            'mujoco>=3.2',
            'rich>=13',
            'rerun-sdk>=0.41; python_version >= "3.11"',
            'xacro>=2',
            'pyarrow>=14',
            'h5py>=3',
            'distributed>=2024.5',
            'duckdb>=1',
            'pytest>=9',
            'pytest-xdist>=3.6',
            'slipcover>=1.1',
            'hypothesis>=6.100',
            'scikit-learn>=1.4',
            'mpmath>=1.3',
            'threadpoolctl>=3',
            # Drives the Chromium of the system through the pages of reports; brings none itself.
            'playwright>=1.48',
            # colcon-core 0.21 refuses setuptools 80 and later.
            'colcon-core==0.21.0',
            'colcon-ros==0.5.0',
            'colcon-common-extensions==0.3.0',
            'setuptools>=68,<80',
        ],
        # The documentation as a site: `make site`.
        'docs': ['mkdocs>=1.6,<2', 'mkdocs-material>=9.5,<10'],
        'lint': ['ruff==0.17.5', 'mypy==2.4.1', 'types-PyYAML'],
    },
    entry_points={
        'console_scripts': [
            'sgp = sgp_ros.cli:main',
            'sgp_node = sgp_ros.ros.sgp_node:main',
            'sgp_lifecycle_node = sgp_ros.ros.sgp_lifecycle_node:main',
            'reaction_wheel = sgp_ros.ros.reaction_wheel:main',
        ],
        # The experiments are beside the package, not a part of it: it installs without them.
        'sgp_ros.commands': [f'{PROOF} = {PROOF}.commands:add_commands']
        * (SOURCES / PROOF).is_dir(),
    },
    zip_safe=False,
)
