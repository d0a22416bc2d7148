#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Generates isotruss_msgs with rosidl and installs it into the virtual environment, whose start-up hook
# puts the environment's lib folder on the library path: nothing needs to be sourced. Messages whose sources
# and tools are those of the installed ones are not built again.
# usage: build_messages.sh VENV
set -eu

venv=$(cd "$1" && pwd)
build=$venv/build/isotruss_msgs
log=$venv/messages.log
installed=$venv/messages.installed
content=$({ find msg_defs -type f | LC_ALL=C sort | xargs -d '\n' cksum; cksum "$0" tools/type_supports.cmake requirements.txt; } | cksum)
[ "$(cat "$venv/messages.content" 2> /dev/null)" != "$content" ] || exit 0
export PATH="$venv/bin:$PATH"
export STATIC_ROSIDL_TYPESUPPORT_CPP=rosidl_typesupport_fastrtps_cpp

echo 'Generating isotruss_msgs (a minute; longer on a busy machine)'
# What is installed serves until the new ones are built, which takes minutes on a busy machine.
[ ! -f "$build/install_manifest.txt" ] || cp "$build/install_manifest.txt" "$installed"
rm -rf "$build"
# Without optimisation: generated code is compiled longer than it runs.
{
    cmake -S msg_defs -B "$build" -G Ninja -Wno-deprecated \
        -DCMAKE_BUILD_TYPE=None -DBUILD_TESTING=OFF \
        -DCMAKE_PROJECT_INCLUDE="$PWD/tools/type_supports.cmake" \
        -DCMAKE_PREFIX_PATH="$venv" -DCMAKE_INSTALL_PREFIX="$venv" \
        -DPython3_EXECUTABLE="$venv/bin/python" \
        -DPython3_INCLUDE_DIR="$(echo "$venv"/include/python3.*)" &&
        cmake --build "$build" &&
        # A message that is no more must not stay importable.
        { [ ! -f "$installed" ] || xargs -d '\n' rm -f < "$installed"; } &&
        cmake --install "$build"
} > "$log" 2>&1 || {
    tail -n 40 "$log" >&2
    echo "Generating isotruss_msgs failed; the whole log is in $log" >&2
    exit 1
}
echo "$content" > "$venv/messages.content"
