# SPDX-License-Identifier: Apache-2.0
"""What the lander's requirements add to its tick, and how fast recorded values are judged.

python3 scripts/bench requirements
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from simclient.machine_build import build_config
from simclient.run import Run, open_run

from ..harness.size import sized
from .lander import CONFIG

ROUNDS = sized(41, 3)
TICKS = sized(20_000, 100)
ROWS = sized(200_000, 100)


def _ns(work: Callable[[], object], count: int) -> float:
    begun = time.perf_counter_ns()
    work()
    return (time.perf_counter_ns() - begun) / count


def _opened(requirements: Path | None = None) -> Run:
    return open_run(*build_config(CONFIG, requirements=requirements))


def requirement_times(folder: Path) -> dict[str, Any]:
    """ns of a tick with and without, in turns; ns to judge a requirement on a recorded tick."""
    none = folder / "none.json"
    none.write_text(json.dumps({"requirements": []}))
    watched, plain = _opened(), _opened(none)
    count = len(watched.observed_by())
    rounds = [(_ns(lambda: watched.step(TICKS), TICKS), _ns(lambda: plain.step(TICKS), TICKS)) for _ in range(ROUNDS)]
    added = [(with_ - without) / count for with_, without in rounds]
    row_bytes = sum(8 for _ in watched.observed())  # as wide as the widest value: zeros are values, too
    rows = bytes(row_bytes * ROWS)
    judged = statistics.median(_ns(lambda: watched.judge(rows, row_bytes), ROWS * count) for _ in range(sized(5, 1)))
    return {
        "requirements": count,
        "tick_ns": statistics.median(with_ for with_, _ in rounds),
        "tick_without_ns": statistics.median(without for _, without in rounds),
        "each_ns": statistics.median(added),
        "judged_ns": judged,
    }


def requirement_rows(times: dict[str, Any]) -> list[tuple[str, str]]:
    what = f"lander's tick with {times['requirements']} requirements, without"
    return [
        (what, f"{times['tick_ns']:.0f} ns, {times['tick_without_ns']:.0f} ns"),
        ("    of each requirement", f"{times['each_ns']:.1f} ns (goal 20)"),
        ("check-bag, a requirement", f"{1e3 / times['judged_ns']:.1f} million ticks/s (goal 1)"),
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for label, figure in requirement_rows(requirement_times(Path(scratch))):
            print(f"{label:56}{figure}")
