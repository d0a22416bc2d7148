# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from glob import glob
import runpy
import sys

from setuptools import find_packages, setup

package_name = 'isotruss_ros'

scripts = {'isotruss': f'{package_name}.executables:isotruss'}
# colcon and Debian's build run these commands, and setup.cfg puts what `ros2 run` starts into
# lib/isotruss_ros. pip runs neither: its scripts are on PATH, where `view` would hide vim's.
if {'install', 'develop'} & set(sys.argv):
    tables = runpy.run_path(f'{package_name}/executables.py')
    names = (*tables['NODES'], *tables['PROGRAMS'])
    scripts |= {name: f'{package_name}.executables:{name}' for name in names}

setup(
    name=package_name,
    version='0.1.0',
    description=(
        'Grasp analysis and manipulation of isoperimetric truss robots: contact forces, force '
        'closure, twists and paths of a held object.'
    ),
    author='isotruss_ros maintainers',
    maintainer='isotruss_ros maintainers',
    maintainer_email='user@todo.todo',
    license='Apache-2.0',
    python_requires='>=3.10',
    # The presets live at the top, where ROS users look for them; by a link they are data of a
    # sub-package too, for a plain `pip install .`, which knows no share folder.
    packages=[
        *find_packages(include=[package_name, f'{package_name}.*']),
        f'{package_name}.config',
    ],
    # By name, so that an editable install is a path, which type checkers follow, and not a hook.
    package_dir={'': '.'},
    package_data={package_name: ['py.typed'], f'{package_name}.config': ['*.yaml', '*.json']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (
            f'share/{package_name}/config',
            [f for kind in ('yaml', 'json', 'rviz', 'xml') for f in glob(f'config/*.{kind}')],
        ),
        (f'share/{package_name}/config/nodes', glob('config/nodes/*')),
        (f'share/{package_name}/config/ros2_control', glob('config/ros2_control/*')),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
    ],
    # Only what `isotruss_ros.core` imports, so that it installs where there is no ROS.
    # The nonnegative least squares of SciPy 1.12 to 1.15 leave quadratic programs unsolved.
    install_requires=[
        'numpy',
        'scipy!=1.12.*,!=1.13.*,!=1.14.*,!=1.15.*',
        'ruamel.yaml',
        'jsonschema',
    ],
    extras_require={
        'demo': ['matplotlib', 'pillow', 'rich'],
        'sweep': ['distributed'],
        'viewer': ['viser', 'mcap', 'rosbags'],
        'mujoco': ['mujoco>=3.11,<5'],
        'learning': ['gymnasium>=1.0,<2'],
        'parquet': ['pyarrow<26'],  # 26 needs NumPy 2, Jazzy has 1.26
        # colcon runs pytest where it finds it here.
        'test': [
            'pytest',
            'pytest-timeout',
            'hypothesis',
            'psutil',
            'openseespylinux',
        ],
    },
    zip_safe=False,
    entry_points={
        'console_scripts': [f'{name} = {function}' for name, function in scripts.items()],
    },
)
