#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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
