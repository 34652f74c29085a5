# SPDX-License-Identifier: Apache-2.0
"""How much `make bench` measures: $FCSL_BENCH_SIZE is `full` (default), or `smallest`: as little as still runs every part of it."""

from __future__ import annotations

import os
import sys
from typing import TypeVar

T = TypeVar("T")

SIZE = os.environ.get("FCSL_BENCH_SIZE") or "full"
if SIZE not in ("full", "smallest"):
    sys.exit(f"FCSL_BENCH_SIZE (make bench SIZE=…) is `full` or `smallest`, not `{SIZE}`")


def sized(full: T, smallest: T) -> T:
    return smallest if SIZE == "smallest" else full


#: What the names of files with figures end in, so that a smallest run leaves figures worth keeping alone.
SUFFIX = sized("", "_smallest")
