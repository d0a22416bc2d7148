#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Builds and tests a fresh clone of both packages as colcon does on a ROS machine, with the Python and
# the ROS of the virtual environment and out of its way.
# usage: colcon.sh VENV FOLDER
set -eu

venv=$(cd "$1" && pwd)
mkdir -p "$2"
folder=$(cd "$2" && pwd)
# What sourcing a ROS installation would have set.
export PATH="$venv/bin:$PATH" AMENT_PREFIX_PATH="$venv" CMAKE_PREFIX_PATH="$venv"
export COLCON_LOG_PATH="$folder/log"

# The files that git knows or would add, and nothing that make has made beside them.
rm -rf "$folder/clone"
mkdir "$folder/clone"
git ls-files -z --cached --others --exclude-standard |
    tar --create --null --files-from=- --ignore-failed-read |
    tar --extract --directory="$folder/clone"
cd "$folder/clone"
set -- --build-base ../clone_build --install-base ../clone_install
tools/workspace.sh build "$@" --cmake-args -Wno-deprecated \
    -DPython3_EXECUTABLE="$venv/bin/python" \
    -DPython3_INCLUDE_DIR="$(echo "$venv"/include/python3.*)"
# Reports of tests that are no more would count.
find ../clone_build -name '*.xml' -path '*test_results*' -delete
# All tests run in `make test`; here the linters of ament, and those that building and installing by
# colcon could break.
tests='style/test_linters.py style/test_packaging.py style/test_launch.py
    core/model/test_robot_file.py nodes/simulator/test_simulator_node.py system/test_processes.py'
expected=$(python -m pytest --collect-only -q $(printf 'test/%s ' $tests) | grep -c ::)
tools/workspace.sh test "$@" --pytest-args -n auto $(printf 'test/%s ' $tests) || failed=1
colcon test-result --test-result-base ../clone_build --verbose
# A plugin can turn one skip into that of the whole run, which would pass.
ran=$(sed -n 's/.*<testsuite [^>]*tests="\([0-9]*\)".*/\1/p' ../clone_build/isotruss_ros/pytest.xml)
[ "$ran" -ge "$expected" ] || { echo "only $ran of $expected tests ran" >&2; exit 1; }
# The last step of the Dockerfile, as far as that the installed demonstration starts.
ln -s ../clone_install install
tools/workspace.sh demo --help > /dev/null || failed=1
exit "${failed:-0}"
