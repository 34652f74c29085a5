#!/usr/bin/env bash
# The second half of `make test`: each package's tests, then those that cross packages. Fails if anything failed.
# With a commit as argument (make test CHANGED=origin/main): of the packages' tests only those that a change since then touches.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
. scripts/env.sh
# Results of an earlier run must not count.
if [ -d build ]; then colcon test-result --test-result-base build --delete-yes > /dev/null; fi
# Each package's tests, and those that cross packages, run on all cores, two at a time on each, because many wait: colcon
# itself goes from package to package, because each waits for those that it needs. Tests share no port, path or ROS
# domain; conftest.py keeps this from pytest's own children.
workers=$(($(nproc) * 2))
parallel=(-n$((workers < 8 ? workers : 8)) --dist=worksteal)
export PYTEST_ADDOPTS="${parallel[*]}"
failed=()
select=()
if [ $# != 0 ]; then
    names=$(python3 scripts/changed_packages.py "$1")
    read -r -a touched <<< "${names//$'\n'/ }"
    select=(--packages-select "${touched[@]}")
    say "changed since $1: ${touched[*]:-no package}"
fi
if [ $# = 0 ] || [ ${#touched[@]} != 0 ]; then
    say "package tests (colcon test) ..."
    heartbeat log/latest_test &
    heartbeat=$!
    # colcon sets PYTEST_ADDOPTS itself for Python packages; the space keeps an option from being taken for its own.
    colcon test "${select[@]}" --pytest-args "${parallel[@]/#/ }" || failed+=("colcon test")
    kill "$heartbeat" 2> /dev/null || true
fi
colcon test-result --test-result-base build --verbose || failed+=("colcon test-result")
say "workspace tests (pytest test) ..."
python3 -m pytest test --junitxml=build/workspace_tests.xml || failed+=("pytest test")
if [ ${#failed[@]} != 0 ]; then
    python3 scripts/failed_tests.py build
    die "failed: $(printf '%s; ' "${failed[@]}")see above"
fi
