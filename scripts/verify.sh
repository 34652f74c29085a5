#!/usr/bin/env bash
# `make verify`: its tools and those of `make bench`, then the checks that scripts/verify/checks.py lists.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
scripts/verify_tools.sh
scripts/bench/harness/setup.sh
. scripts/env.sh
exec python3 scripts/verify "$@"
