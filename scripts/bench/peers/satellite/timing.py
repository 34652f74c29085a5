# SPDX-License-Identifier: Apache-2.0
"""How long a peer takes."""

from __future__ import annotations

import time
from collections.abc import Callable

from .case import STEP_S


def time_seconds(second: Callable[[int], None], seconds: int) -> list[float]:
    """ns per step in each simulated second; `second` gets its number, from 1 on."""
    times = []
    for number in range(1, seconds + 1):
        begun = time.perf_counter_ns()
        second(number)
        times.append((time.perf_counter_ns() - begun) * STEP_S)
    return times
