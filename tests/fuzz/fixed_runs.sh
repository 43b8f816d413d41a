#!/bin/sh
# A fixed number of inputs for one fuzz program: fixed_runs.sh PROGRAM RUNS FOLDER CORPUS...
set -eu
program=$1 runs=$2 folder=$3
shift 3
found=$(mktemp -d "$folder/found.XXXXXX")
trap 'rm -rf "$found"' EXIT
# What crashes or hangs is kept as FOLDER/crash-... and named in the output.
"$program" -seed=1 -runs="$runs" -max_len=1200 -len_control=0 -timeout=10 -rss_limit_mb=1024 -artifact_prefix="$folder/" \
    -print_final_stats=1 "$found" "$@"
