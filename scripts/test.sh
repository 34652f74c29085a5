#!/usr/bin/env bash
# The second half of `make test`, in the workspace's environment; scripts/test.py says what it runs.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
. scripts/env.sh
exec python3 scripts/test.py "$@"
