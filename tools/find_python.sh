#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Prints the command of a Python of one version, or another where there is none.
# usage: find_python.sh VERSION OTHERWISE
for python in "python$1" "$HOME"/.pyenv/versions/"$1".*/bin/python; do
    if "$python" -c 'import ensurepip, venv' 2> /dev/null; then
        echo "$python"
        exit 0
    fi
done
echo "$2"
