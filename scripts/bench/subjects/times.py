# SPDX-License-Identifier: Apache-2.0
"""What it costs to measure the instances of a machine (fcsl build --times): a chain of trivial ones.

python3 scripts/bench times
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.library import build_library
from simclient.run import Run, open_run

from ..harness.size import sized
from .chain import LINK, chain

LINKS = 20
ROUNDS = sized(41, 3)
TICKS = sized(20_000, 100)


def _opened(folder: Path, times: bool) -> Run:
    output = folder / f"times_{times}"
    output.mkdir()
    (output / "link.py").write_text(LINK)
    (output / "chain.json").write_text(json.dumps(chain(LINKS)))
    build_library([output / "chain.json"], output / "libchain.so", times=times)
    return open_run(output / "libchain.so", None)


def _tick_ns(run: Run) -> float:
    begun = time.perf_counter_ns()
    run.step(TICKS)
    return (time.perf_counter_ns() - begun) / TICKS


def instance_time_costs(folder: Path) -> dict[str, Any]:
    """ns of a tick with and without, in turns."""
    measured, plain = (_opened(folder, times) for times in (True, False))
    rounds = [(_tick_ns(measured), _tick_ns(plain)) for _ in range(ROUNDS)]
    return {
        "tick_ns": statistics.median(with_ for with_, _ in rounds),
        "tick_without_ns": statistics.median(without for _, without in rounds),
        "each_ns": statistics.median((with_ - without) / LINKS for with_, without in rounds),
    }


def instance_time_rows(costs: dict[str, Any]) -> list[tuple[str, str]]:
    what = f"tick of {LINKS} trivial instances, measured and not"
    return [
        (what, f"{costs['tick_ns']:.0f} ns, {costs['tick_without_ns']:.0f} ns"),
        ("    of each instance", f"{costs['each_ns']:.1f} ns (goal 100)"),
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for label, figure in instance_time_rows(instance_time_costs(Path(scratch))):
            print(f"{label:56}{figure}")
