#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Tests the core and the plant in MuJoCo, without ROS, with the versions of one system.
# usage: version_matrix.sh noble|trixie|newest FOLDER [PYTEST ARGUMENTS]
set -eu

case $1 in
    # Ubuntu 24.04; Matplotlib 3.6.3 has no wheel for its Python.
    noble) python=3.12 versions='numpy==1.26.4 scipy==1.11.4 ruamel.yaml==0.17.21 jsonschema==4.10.3
        matplotlib==3.7.3 mujoco==3.11.*' ;;
    # Debian 13, but for SciPy: 1.15.3 is refused by setup.py.
    trixie) python=3.13 versions='numpy==2.2.4 scipy==1.16.3 ruamel.yaml==0.18.10 jsonschema==4.19.2
        matplotlib==3.10.1 mujoco==3.17.*' ;;
    newest) python=3.13 versions='numpy scipy ruamel.yaml jsonschema matplotlib mujoco' ;;
    *)
        echo "unknown versions '$1': must be noble, trixie or newest" >&2
        exit 1
        ;;
esac
name=$1
venv=$2/$1
shift 2
command=$("$(dirname "$0")/find_python.sh" "$python" python3)
[ -x "$venv/bin/python" ] || "$command" -m venv "$venv"
# Neither colcon nor ament's style checks are to look inside.
touch "$venv/COLCON_IGNORE" "$venv/AMENT_IGNORE"
# Not the package itself: the tests of its sources run beside their helpers.
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade --upgrade-strategy eager \
    $versions pytest pytest-timeout pytest-xdist hypothesis psutil pillow
echo "== $name: Python $python"
"$venv/bin/python" -m pip freeze | grep -i -E '^(numpy|scipy|ruamel.yaml|jsonschema|matplotlib|mujoco)=='
PYTHONPATH=. "$venv/bin/python" -m pytest -q -n auto -m 'not nightly and not system' "$@"
