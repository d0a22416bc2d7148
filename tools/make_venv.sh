#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Makes the virtual environment, after looking for what only the machine's owner can install.
# usage: make_venv.sh PYTHON VENV
set -eu

missing() {
    echo "$1" >&2
    exit 1
}

apt='sudo apt install build-essential python3-venv'
command -v "$1" > /dev/null || missing "There is no command '$1'; install Python 3.10 to 3.13 with: $apt"
# A virtual environment that is active, maybe the very one to be made, is only a shell around this one.
python=$("$1" -c 'import sys; print(getattr(sys, "_base_executable", sys.executable))' 2> /dev/null) ||
    missing "'$1' is no Python; name one of 3.10 to 3.13: make PYTHON=python3.12"
about=$("$python" -c 'import platform as p; print("%s.%s " % p.python_version_tuple()[:2] + p.python_implementation())')
case $about in
    '3.10 CPython' | '3.11 CPython' | '3.12 CPython' | '3.13 CPython') ;;
    *) missing "'$1' is Python $about, and CPython 3.10 to 3.13 is needed; name one: make PYTHON=python3.12" ;;
esac
"$python" -c 'import ensurepip, venv' 2> /dev/null ||
    missing "The venv module of '$1' is missing or incomplete; install it with: sudo apt install python3-venv (or python${about% *}-venv)"
for tool in cc c++; do
    command -v "$tool" > /dev/null || missing "There is no compiler ('$tool'); install one with: $apt"
done

# Scripts in the environment hold its path, and its libraries fit one Python only.
identity="$("$python" -c 'import sys; print(sys.version.split()[0], sys.base_prefix)') $(pwd)/$2"
[ "$(cat "$2/stamps/python" 2> /dev/null)" != "$identity" ] || exit 0

echo "Making $2 with Python ${identity%% *} (once; one to three minutes, 0.7 to 1.6 GB of disk)"
"$python" -m venv --clear "$2"
# Neither colcon nor ament's style checks are to look inside.
touch "$2/COLCON_IGNORE" "$2/AMENT_IGNORE"
mkdir "$2/stamps"
echo "$identity" > "$2/stamps/python"
