# SPDX-License-Identifier: Apache-2.0
"""How long the instances of a machine take that was built with --times (docs/reference/variables.md#times)."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .c_run import CTime

#: The name of the step as a whole; no instance is called so.
STEP = "machine"
NOT_MEASURED = (
    "machine `{}` does not measure its instances: build it with `fcsl build --times`, or let tests and simulations build "
    "it with FCSL_TIMES=1 in their environment"
)
_COUNTS = ("runs", "total_ns", "mean_ns", "p50_ns", "p99_ns", "max_ns")


@dataclass(frozen=True)
class InstanceTime:
    """Of an instance: `runs`, faulted ones included, and their times in ns: copying of inputs, execute, verdict on its
    health. `p50_ns` and `p99_ns` are at most 1/32 too large. `share`: of the time of all steps, 0 to 1."""

    runs: int
    total_ns: int
    mean_ns: int
    p50_ns: int
    p99_ns: int
    max_ns: int
    share: float


def of_stats(stats: Mapping[str, Mapping[str, int]]) -> dict[str, InstanceTime]:
    """By instance, and of the STEP: `times` of the variable server's `stats`. Empty if the machine is not measured."""
    step_ns = stats[STEP]["total_ns"] if stats else 0
    shares = {name: row["total_ns"] / step_ns if step_ns else 0.0 for name, row in stats.items()}
    return {
        name: InstanceTime(**{count: row[count] for count in _COUNTS}, share=shares[name])
        for name, row in stats.items()
    }


def read_times(lib: Any, handle: int) -> dict[str, InstanceTime]:
    """The same of a run: `lib` is the runtime, `handle` an fcsl_run_t."""
    rows: dict[str, dict[str, int]] = {}
    found = CTime()
    while lib.fcsl_run_time(handle, len(rows), ctypes.byref(found)) == 0:
        rows[found.name.decode()] = {count: getattr(found, count) for count in _COUNTS}
    return of_stats(rows)
