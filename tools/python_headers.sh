#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

# Puts Python's C headers, which the generated messages are compiled with, into the virtual environment.
# usage: python_headers.sh VENV
#
# python3-venv does not bring them. Where they are not installed they are unpacked from the distribution's
# package, which needs no rights, so that nothing more has to be installed by hand.
set -eu

venv=$(cd "$1" && pwd)
version=$("$venv/bin/python" -c 'import sys; print("python%d.%d" % sys.version_info[:2])')
headers=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
target=$venv/include/$version

rm -rf "$target"
mkdir -p "$venv/include"
if [ -f "$headers/Python.h" ]; then
    ln -s "$headers" "$target"
    exit 0
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
if ! (cd "$work" && apt-get download "lib$version-dev" && dpkg-deb -x ./*.deb .) > "$work/log" 2>&1; then
    echo "Python's C headers are missing; install them with: sudo apt update; sudo apt install $version-dev" >&2
    exit 1
fi
cp -r "$work/usr/include/$version" "$target"
# The one of the package only points to this one, by a path that a compiler would not find here.
cp "$work"/usr/include/*/"$version"/pyconfig.h "$target/pyconfig.h"
