#!/bin/sh
# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# Fuzzes the readers one after the other; a finding ends the run and is a file in .fuzz/.
# usage: run.sh PYTHON MINUTES
set -eu

tools=$(dirname "$0")
# Threads of the linear algebra wait for each other, spinning.
export OPENBLAS_NUM_THREADS=1
for target in robot_file measurements; do
    found=.fuzz/$target
    mkdir -p "$found/corpus"
    echo "Fuzzing the reader of $target for $2 minutes"
    # An input that takes a minute (of a busy machine) is a finding too.
    "$1" "$tools/$target.py" -max_total_time=$(($2 * 60)) -max_len=20000 -timeout=60 \
        -report_slow_units=60 -rss_limit_mb=4096 -dict="$tools/$target.dict" \
        -artifact_prefix="$found/" -print_final_stats=1 "$found/corpus" \
        "$tools/corpus/$target" ||
        { echo "Found something: see the files in $found/" >&2; exit 1; }
done
