# SPDX-License-Identifier: Apache-2.0
"""How far `make verify` goes: $FCSL_EFFORT is `ci` (default; the same work every time) or `full` (searches for a time)."""

from __future__ import annotations

import os
import sys
from typing import TypeVar

T = TypeVar("T")

EFFORT = os.environ.get("FCSL_EFFORT") or "ci"
if EFFORT not in ("ci", "full"):
    sys.exit(f"FCSL_EFFORT (make verify EFFORT=…) is `ci` or `full`, not `{EFFORT}`")


def scaled(ci: T, full: T) -> T:
    return full if EFFORT == "full" else ci
