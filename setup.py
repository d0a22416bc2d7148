# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from glob import glob

from setuptools import find_packages, setup

package_name = 'isotruss_ros'

setup(
    name=package_name,
    version='0.1.0',
    description='Kinematics and manipulation control of isoperimetric truss robots.',
    author='isotruss_ros maintainers',
    author_email='maintainers@example.org',
    maintainer='isotruss_ros maintainers',
    maintainer_email='maintainers@example.org',
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
        # colcon runs pytest where it finds it here.
        'test': [
            'pytest',
            'pytest-timeout',
            'hypothesis',
            'psutil',
            'PyNiteFEA',
            'openseespylinux',
        ],
    },
    zip_safe=False,
    entry_points={
        'console_scripts': [
            'simulator = isotruss_ros.executables:simulator',
            'manipulation = isotruss_ros.executables:manipulation',
            'grasp_analysis = isotruss_ros.executables:grasp_analysis',
            'path_follower = isotruss_ros.executables:path_follower',
            'grasp_planner = isotruss_ros.executables:grasp_planner',
            'pick_and_place = isotruss_ros.executables:pick_and_place',
            'viewer = isotruss_ros.executables:viewer',
            'record = isotruss_ros.executables:record',
            'pluck = isotruss_ros.executables:pluck',
            'calibration = isotruss_ros.executables:calibration',
            'check_rollers = isotruss_ros.executables:check_rollers',
            'preflight = isotruss_ros.executables:preflight',
            'state_estimator = isotruss_ros.executables:state_estimator',
            'view = isotruss_ros.demo.view:main',
            'replay = isotruss_ros.cli.replay:main',
            'demo = isotruss_ros.demo.__main__:main',
            'plan_grasps = isotruss_ros.cli.plan_grasps:main',
            'fit_tube_stiffness = isotruss_ros.cli.fit_tube_stiffness:main',
            'calibrate_home = isotruss_ros.cli.calibrate:home',
            'calibrate_stiffness = isotruss_ros.cli.calibrate:stiffness',
            'isotruss = isotruss_ros.cli.operate:main',
            'export_mujoco = isotruss_ros.cli.export_mujoco:main',
        ],
    },
)
