#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Generates isotruss_msgs with rosidl and installs it into the virtual environment, whose start-up hook
# puts the environment's lib folder on the library path: nothing needs to be sourced.
# usage: build_messages.sh VENV
set -eu

venv=$(cd "$1" && pwd)
build=$venv/build/isotruss_msgs
log=$venv/messages.log
installed=$venv/messages.installed
export PATH="$venv/bin:$PATH"

echo 'Generating isotruss_msgs (a minute; longer on a busy machine)'
# What is installed serves until the new ones are built, which takes minutes on a busy machine.
[ ! -f "$build/install_manifest.txt" ] || cp "$build/install_manifest.txt" "$installed"
rm -rf "$build"
{
    cmake -S msg_defs -B "$build" -G Ninja -Wno-deprecated \
        -DCMAKE_BUILD_TYPE=Release -DBUILD_TESTING=OFF \
        -DCMAKE_PREFIX_PATH="$venv" -DCMAKE_INSTALL_PREFIX="$venv" \
        -DPython3_EXECUTABLE="$venv/bin/python" \
        -DPython3_INCLUDE_DIR="$(echo "$venv"/include/python3.*)" &&
        cmake --build "$build" &&
        # A message that is no more must not stay importable.
        { [ ! -f "$installed" ] || xargs rm -f < "$installed"; } &&
        cmake --install "$build"
} > "$log" 2>&1 || {
    tail -n 40 "$log" >&2
    echo "Generating isotruss_msgs failed; the whole log is in $log" >&2
    exit 1
}
