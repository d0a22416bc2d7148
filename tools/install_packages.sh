#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Installs pinned packages into the virtual environment, by uv, or by pip where there is no uv.
# usage: [INSTALLER=pip] install_packages.sh VENV REQUIREMENTS...
set -eu

venv=$(cd "$1" && pwd)
shift
python=$venv/bin/python
log=$venv/install.log

by_pip() {
    "$python" -m pip install --quiet --disable-pip-version-check --progress-bar off "$@" > "$log" 2>&1
}

# uv does not read the settings of pip; of these it needs the index.
by_uv() {
    index=$("$python" -m pip config list | sed -n "s/^.*[.:]index-url='\(.*\)'$/\1/p" | tail -n 1)
    UV_LINK_MODE=${UV_LINK_MODE:-hardlink} UV_DEFAULT_INDEX=${index:-${UV_DEFAULT_INDEX:-https://pypi.org/simple}} \
        "$venv/bin/uv" pip install --quiet --python "$python" "$@" > "$log" 2>&1
}

install() {
    [ ! -x "$venv/bin/uv" ] || ! by_uv "$@" || return 0
    [ ! -x "$venv/bin/uv" ] || echo 'uv fails; pip installs the same versions, in some minutes'
    by_pip "$@" || {
        cat "$log" >&2
        echo 'Installing the packages failed (see above); run the same command again' \
            'once the network answers: what was fetched is kept.' >&2
        exit 1
    }
}

# The installers come first: they build what has no wheel, so that their versions are the pinned ones too.
if ! [ -e "$venv/installers.txt" ]; then
    if [ "${INSTALLER:-uv}" = pip ]; then
        echo 'pip installs the packages, as INSTALLER says: some minutes'
    elif ! by_pip --retries 1 --only-binary :all: "$(sed -n 's/^\(uv==[^ ]*\).*/\1/p' requirements.txt)"; then
        echo 'There is no uv here; pip installs the same versions, in some minutes'
    fi
    grep -E '^(pip|setuptools|wheel)==' requirements.txt > "$venv/installers.new"
    install -r "$venv/installers.new"
    mv "$venv/installers.new" "$venv/installers.txt"
fi
for file; do
    echo "Installing the packages of $file"
    case $file in
        # uv is there by now, or cannot be had.
        requirements.txt) grep -v '^uv==' "$file" > "$venv/packages.txt" && file=$venv/packages.txt ;;
    esac
    install --no-build-isolation -r "$file"
done
