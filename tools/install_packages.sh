#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Installs the pinned packages into the virtual environment and makes the ROS wheels build messages.
# usage: install_packages.sh VENV REQUIREMENTS...
set -eu

tools=$(dirname "$0")
venv=$(cd "$1" && pwd)
shift
python=$venv/bin/python
log=$venv/install.log

install() {
    # A dot for each package that comes: minutes of silence look like an end.
    { "$python" -m pip install --disable-pip-version-check --progress-bar off "$@" 2> "$log" ||
        touch "$log.failed"; } | while read -r word _; do
        case $word in Collecting | Processing) printf . ;; esac
    done
    echo
    [ ! -e "$log.failed" ] || {
        rm "$log.failed"
        cat "$log" >&2
        echo 'Installing the packages failed (see above); run the same command again' \
            'once the network answers: what was fetched is kept.' >&2
        exit 1
    }
}

# The installers come first and build what has no wheel, so that their versions are the pinned ones too.
grep -E '^(pip|setuptools|wheel)==' requirements.txt > "$venv/installers.txt"
echo "Installing the packages of $*"
install -r "$venv/installers.txt"
set -- $(printf -- '-r %s ' "$@")
install --no-build-isolation "$@"

"$tools/python_headers.sh" "$venv"
"$python" "$tools/relocate_wheels.py"
