# SPDX-License-Identifier: Apache-2.0
"""The bare step: chains of trivial instances, each fed by the one before, beside the same chain by hand in C."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.library import build_library

from ..harness.native import code_bytes, compile_program
from ..harness.size import sized

SIZES = sized((3, 17, 100, 1000), (3, 17))
ROUNDS = sized(401, 3)
LINK = """\
class Link:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = self.x + 1.0
"""


def chain(links: int, max_wcet_us: int = 0) -> dict[str, Any]:
    """A machine of that many trivial instances in a row, every one of them due in every tick."""
    instance: dict[str, Any] = {"algorithm": "Link"}
    if max_wcet_us:
        instance["max_wcet_us"] = max_wcet_us
    return {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {"Link": {"source": "link.py"}},
        "instances": {f"link{n}": instance for n in range(links)},
        "connections": [{"from": f"link{n}.y", "to": f"link{n + 1}.x"} for n in range(links - 1)],
        "states": {"RUN": {"schedule": {f"link{n}": 1000 for n in range(links)}}},
        "transitions": [],
    }


def build_chain(folder: Path, links: int, max_wcet_us: int) -> tuple[Path, float]:
    """The library of a chain, and the seconds that its build took."""
    name = f"chain{links}{'timed' if max_wcet_us else ''}"
    (folder / "link.py").write_text(LINK)
    config = folder / f"{name}.json"
    config.write_text(json.dumps(chain(links, max_wcet_us)))
    begun = time.monotonic()
    library = folder / name / f"lib{name}.so"
    build_library([config], library)
    return library, time.monotonic() - begun


def chain_times(folder: Path, sizes: tuple[int, ...] = SIZES, rounds: int = ROUNDS) -> list[dict[str, Any]]:
    """Per size: ns per step (plain, timed with a clock, timed without one, by hand), clock readings, bytes, build time."""
    program = compile_program(["subjects/chain.c", "peers/chain_by_hand.c", "harness/timing.c"], folder / "chain")
    arguments, builds = [], []
    for links in sizes:
        (plain, seconds), (timed, _) = (build_chain(folder, links, limit) for limit in (0, 1_000_000))
        arguments += [str(links), str(plain), str(timed)]
        sizes_of = {"code_bytes": code_bytes(plain.with_name(f"chain{links}.c")), "library_bytes": plain.stat().st_size}
        builds.append({"build_s": seconds, **sizes_of})
    line = [str(program), str(rounds), *arguments]
    times = json.loads(subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return [{**figures, **build} for figures, build in zip(times, builds, strict=True)]


def _spread(figure: dict[str, float], unit: str = "") -> str:
    return f"{figure['median']:.2f}{unit} ({figure['low']:.2f} to {figure['high']:.2f})"


def chain_rows(facts: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The table: a head, and a row per size."""
    rows: list[tuple[str, ...]] = [
        (
            "instances",
            "step",
            "each",
            "by hand",
            "÷ by hand",
            "clock reads",
            "timed, each besides",
            "code",
            "library, each",
            "state",
            "build",
        )
    ]
    for f in facts:
        n = f["links"]
        rows.append(
            (
                str(n),
                f"{f['plain_ns']:.1f} ns",
                f"{f['plain_ns'] / n:.2f} ns",
                f"{f['by_hand_ns']:.1f} ns",
                _spread(f["ratio"]),
                f"{f['reads_per_step']:g}",
                _spread(f["besides_ns"], " ns"),
                f"{f['code_bytes']} B",
                f"{f['library_bytes'] / n:.0f} B",
                f"{f['state_bytes']} B",
                f"{f['build_s']:.1f} s",
            )
        )
    return rows


def chain_summary(facts: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """The same as lines of one figure each."""
    rows = []
    for f in facts:
        rows += [
            (f"bare step, {f['links']} trivial instances", f"{f['plain_ns']:.1f} ns, by hand {f['by_hand_ns']:.1f}"),
            ("    ÷ by hand (goal 1.5)", _spread(f["ratio"])),
            (
                "    each, when timed, besides the clock",
                f"{_spread(f['besides_ns'], ' ns')} (goal 3), {f['reads_per_step']:g} readings",
            ),
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        for row in chain_rows(chain_times(Path(name), tuple(map(int, sys.argv[1:])) or SIZES)):
            print("".join(f"{cell:>25}" for cell in row))
