#!/usr/bin/env bash
# `make build`: colcon build of all packages, or of those named as arguments with what they depend on.
#   scripts/build.sh [--no-tests] [PACKAGE ...]    --no-tests: leaves out programs that only tests run, until the next build
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
# Build on the underlay alone, whatever the calling shell had sourced: a build must not see an older install of itself.
unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH PYTHONPATH
. scripts/underlay.sh
[ -n "${COLCON_DEFAULTS_FILE:-}" ] || exit 1
# Ninja looks at an unchanged package in a tenth of make's time. A folder that was built before keeps what it was built with.
if type -P ninja > /dev/null; then export CMAKE_GENERATOR="${CMAKE_GENERATOR:-Ninja}"; fi
tests=ON
if [ "${1:-}" = --no-tests ]; then
    tests=OFF
    shift
    rm -f build/.fcsl-built # the programs of tests are no longer up to date
fi
# Two builds of one tree damage each other's files. The descriptor goes to no process that outlives this one.
mkdir -p build
exec 4> build/.lock
if ! flock -n 4; then
    say "another build of this workspace runs; waiting for it"
    flock 4
fi
started=$(mktemp)
# colcon names packages as they start and finish; between, show every 10 s what the compiler is at.
heartbeat log/latest_build 4>&- &
heartbeat=$!
trap 'kill "$heartbeat" 2> /dev/null || true; rm -f "$started"' EXIT
if ! colcon build ${1:+--packages-up-to "$@"} --cmake-args "-DBUILD_TESTING=$tests"; then
    for rc in build/*/colcon_build.rc; do
        package=$(basename "$(dirname "$rc")")
        if [[ $(cat "$rc") =~ ^[1-9] ]]; then tail -n 40 "log/latest_build/$package/stderr.log" >&2 2> /dev/null || true; fi
    done
    die "the build failed; its messages are above, complete logs in log/latest_build"
fi
# What is installed is links to the sources; colcon leaves those behind whose source has moved away.
find install -xtype l -delete
# The stamp bears the time of the start, so that a file saved during the build counts as newer; in it, what was built of what.
stamp=
if [ $# = 0 ]; then stamp=build/.fcsl-built; elif [ $tests = OFF ]; then stamp=build/.fcsl-built-part; fi
if [ -n "$stamp" ]; then
    built_of "$@" > "$stamp"
    touch -r "$started" "$stamp"
fi
