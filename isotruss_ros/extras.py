# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages that parts of this package need beyond the core, and how each is installed."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import importlib.util

from isotruss_ros.core.errors import IsotrussError

#: Extra of setup.py that installs a package, by the name under which it is imported.
EXTRAS = {
    'PIL': 'demo',
    'matplotlib': 'demo',
    'rich': 'demo',
    'distributed': 'sweep',
    'mcap': 'viewer',
    'rosbags': 'viewer',
    'viser': 'viewer',
    'mujoco': 'mujoco',
    'gymnasium': 'learning',
    'pyarrow': 'parquet',
}
#: Package of Ubuntu, by the name under which it is imported.
UBUNTU_PACKAGES = {
    'PIL': 'python3-pil',
    'matplotlib': 'python3-matplotlib',
    'rich': 'python3-rich',
}
#: Packages of ROS that are not named `*_msgs`.
ROS_PACKAGES = {'ament_index_python', 'builtin_interfaces', 'rcl_interfaces', 'rclpy', 'std_srvs'}
#: Error message if ROS is not installed.
NO_ROS = (
    'this needs ROS 2: in a checkout of isotruss_ros, `make venv` installs it without a ROS '
    'installation; then .venv/bin/python and .venv/bin/isotruss'
)
#: Error message if the package isotruss_msgs is not built.
NO_MESSAGES = (
    'isotruss_msgs, the interface package of isotruss_ros, is not built. It is the folder\n'
    'msg_defs of isotruss_ros, where colcon does not look by itself. In the workspace:\n'
    '  ln -s isotruss_ros/msg_defs src/isotruss_msgs\n'
    '  colcon build && source install/setup.bash'
)


class MissingPackageError(IsotrussError, ImportError):
    """Error: a package is missing; the message names its installation."""

    def __init__(self, error: ModuleNotFoundError) -> None:
        super().__init__(explain_missing(error))


def explain_missing(error: ModuleNotFoundError) -> str:
    """Return the installation of the missing package; raise the error again for other modules."""
    package = (error.name or '').partition('.')[0]
    if package in EXTRAS:
        extra = EXTRAS[package]
        ubuntu = UBUNTU_PACKAGES.get(package, '')
        ubuntu = f'; with an installed ROS: sudo apt install {ubuntu}' if ubuntu else ''
        return (
            f"this needs {package}: pip install 'isotruss_ros[{extra}]'; "
            f"in a checkout of isotruss_ros: pip install '.[{extra}]'" + ubuntu
        )
    if package == 'isotruss_msgs' and importlib.util.find_spec('rclpy') is not None:
        return NO_MESSAGES
    if package in ROS_PACKAGES or package.endswith('_msgs'):
        return NO_ROS
    raise error


@contextlib.contextmanager
def explained_imports() -> Iterator[None]:
    """End the program if an import in the block fails; print how the package is installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise SystemExit(explain_missing(error)) from None
