#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# The steps on a machine with ROS 2 Jazzy, in the folder of a checkout; the Dockerfile runs them.
# usage: workspace.sh install|build|test|demo [ARGUMENTS of colcon, or of the demonstration]
set -eu

step=$1
shift
case "$step" in
    install)
        apt-get update
        rosdep update
        rosdep install --from-paths . msg_defs --ignore-src --default-yes
        ;;
    # colcon looks no deeper where it found a package: msg_defs has to be named.
    build) colcon build --base-paths . msg_defs "$@" ;;
    test)
        colcon test --base-paths . msg_defs --event-handlers console_direct+ --return-code-on-test-failure "$@"
        ;;
    demo)
        set +u
        . install/setup.sh
        exec install/isotruss_ros/lib/isotruss_ros/demo "$@"
        ;;
    *) echo "workspace.sh: step $step: must be install, build, test or demo" >&2; exit 2 ;;
esac
