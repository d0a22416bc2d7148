#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Builds the wheel of a fresh clone, installs it into an empty environment by one line, without ROS and
# without a compiler, and runs the Python of the README there; then, with the extra demo, what the README
# names next.
# usage: check_wheel.sh VENV
set -eu

python=$(cd "$1" && pwd)/bin/python
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# The files that git knows or would add, and nothing that make has made beside them.
mkdir "$folder/clone"
git ls-files -z --cached --others --exclude-standard |
    tar --create --null --files-from=- --ignore-failed-read |
    tar --extract --directory="$folder/clone"
"$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --use-pep517 \
    --wheel-dir "$folder/dist" "$folder/clone"

"$python" -m venv "$folder/empty"
PATH="$folder/empty/bin:/usr/bin:/bin"
export PATH CC=none
cd "$folder"
begin=$(date +%s)
pip install --quiet --disable-pip-version-check --only-binary :all: dist/*.whl
echo "installed in $(($(date +%s) - begin)) s"
sed -n '/^```python$/,/^```$/p' clone/README.md | sed '/^```/d' > readme.py
python -W error readme.py
for name in demo view 'plan_grasps --center 0.5 0.3 --diameter 0.3' move manipulation; do
    # The words of the name are arguments.
    if isotruss $name 2> errors; then
        echo "isotruss $name: must name the package that is missing"
        exit 1
    fi
    test "$(wc -l < errors)" = 1 || { cat errors; exit 1; }
done
pip install --quiet --disable-pip-version-check --only-binary :all: "$(echo dist/*.whl)[demo,learning]"
for example in clone/examples/[!r]*.py; do
    echo "$example"
    python "$example" > /dev/null
done
python clone/tools/notebooks.py clone/examples/held_object.ipynb
isotruss plan_grasps --center 0.5 0.3 --diameter 0.3 > /dev/null
isotruss fit_tube_stiffness --help > /dev/null
