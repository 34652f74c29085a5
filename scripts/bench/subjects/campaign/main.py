# SPDX-License-Identifier: Apache-2.0
"""`fcsl campaign` on all cores, beside as many independent processes that fly the same cases in a loop; and its memory.

python3 scripts/bench campaign
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Any

import pyarrow.parquet as pq

from ...harness.native import BENCH
from ...harness.size import sized

HERE = Path(__file__).resolve().parent
STUDY = BENCH.parents[1] / "examples/lander/sim/touchdown.study.json"
PROCESSES = len(os.sched_getaffinity(0))
#: Cases of a run. What starts and ends a run is in both, so the difference is that of the cases between.
FEW, MANY = sized((200, 1200), (4, 12))
#: Of which the fastest counts.
ROUNDS = sized(6, 1)
#: Cases of the runs that are watched for their memory, and how long one of their flights is, s.
WATCHED: tuple[int, ...] = sized((5000, 20_000), (20,))
WATCHED_S = 0.1
SAMPLE_S = 0.05
GOAL = 0.9
#: What the processes of a loop do (loop.py).
LOOPS = ("measured", "flown")

Facts = dict[str, Any]


def campaign_figures(folder: Path) -> Facts:
    return {"processes": PROCESSES, **rates(folder), "memory": [memory(folder, cases) for cases in WATCHED]}


# ---- cases a second --------------------------------------------------------------------------------------------------


def rates(folder: Path) -> Facts:
    """Cases per second of the campaign and of both loops, which take turns. `whole`: with the start of the command, its table and
    its picture. `processor_ms`: of all processes, a case; other work on the computer changes it less."""
    works: dict[str, Callable[[int], None]] = {"campaign": lambda cases: _campaign(folder, cases)}
    works |= {name: partial(_loop, folder, name) for name in LOOPS}
    runs = [
        {(name, cases): _timed(work, cases) for cases in (FEW, MANY) for name, work in works.items()}
        for _ in range(ROUNDS)
    ]
    wall_s, processor_s = ({key: min(run[key][i] for run in runs) for key in runs[0]} for i in (0, 1))
    facts: Facts = {"whole": MANY / wall_s["campaign", MANY]}
    for name in works:
        facts[name] = {
            "per_s": (MANY - FEW) / (wall_s[name, MANY] - wall_s[name, FEW]),
            "processor_ms": (processor_s[name, MANY] - processor_s[name, FEW]) / (MANY - FEW) * 1e3,
        }
    return facts


def _timed(work: Callable[[int], None], cases: int) -> tuple[float, float]:
    """Wall time, and processor time of all processes that it starts, s."""
    before, begun = getrusage(RUSAGE_CHILDREN), time.monotonic()
    work(cases)
    took_s, after = time.monotonic() - begun, getrusage(RUSAGE_CHILDREN)
    return took_s, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _command(study: Path, cases: int, results: Path) -> list[str]:
    return ["fcsl-sim", "campaign", str(study), "--cases", str(cases), "-o", str(results), "--restart"]


def _campaign(folder: Path, cases: int) -> None:
    done = subprocess.run(_command(STUDY, cases, folder / f"campaign_{cases}"), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"fcsl campaign: {done.stdout}{done.stderr}")


def _loop(folder: Path, what: str, cases: int) -> None:
    """Processes share the cases. Raises RuntimeError if one ends otherwise than in the campaign."""
    line = [sys.executable, str(HERE / "loop.py"), str(STUDY), str(cases)]
    processes = [
        subprocess.Popen([*line, str(first), str(PROCESSES), what], stdout=subprocess.PIPE, text=True)
        for first in range(PROCESSES)
    ]
    texts = [process.communicate()[0] for process in processes]
    if any(process.returncode for process in processes):
        raise RuntimeError("a process that flies in a loop failed")
    flown = {int(case): digest for text in texts for case, digest in json.loads(text).items()}
    table = pq.read_table(folder / f"campaign_{cases}" / "cases.parquet", columns=["hash"])
    if [flown[case] for case in range(cases)] != table["hash"].to_pylist():
        raise RuntimeError("campaign and loop do not fly the same")


# ---- memory ----------------------------------------------------------------------------------------------------------


def memory(folder: Path, cases: int) -> Facts:
    """Peaks of resident memory, MB: of the command, and of the largest of the processes that fly."""
    study = folder / "watched.study.json"
    short = json.loads(STUDY.read_text()) | {"duration": WATCHED_S}
    study.write_text(json.dumps(short | {"simulation": str(STUDY.parent / short["simulation"])}))
    with subprocess.Popen(
        _command(study, cases, folder / "watched"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as command:
        own, fliers = 0.0, 0.0
        while command.poll() is None:
            own = max(own, _peak_mb(command.pid))
            fliers = max([fliers, *map(_peak_mb, _children(command.pid))])
            time.sleep(SAMPLE_S)
    if command.returncode not in (0, 1):  # 1: not every short flight has landed
        raise RuntimeError("fcsl campaign with short flights failed")
    return {"cases": cases, "command_mb": own, "flier_mb": fliers}


def _children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except FileNotFoundError:
        return []


def _peak_mb(pid: int) -> float:
    """0 of a process that has ended."""
    try:
        found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return int(found[1]) / 1000 if found else 0.0


# ---- the table -------------------------------------------------------------------------------------------------------


def campaign_rows(facts: Facts) -> list[tuple[str, str]]:
    def per_s(name: str) -> str:
        return f"{facts[name]['per_s']:.0f} cases/s, {facts[name]['processor_ms']:.2f} ms"

    def ratio(name: str, goal: str = "") -> str:
        return f"{facts['campaign']['per_s'] / facts[name]['per_s']:.2f}{goal}"

    rows = [
        (f"campaign, {facts['processes']} processes; processor time", per_s("campaign")),
        (f"    with start and report, {MANY} cases", f"{facts['whole']:.0f} cases/s"),
        ("    independent processes, the same metrics", per_s("measured")),
        ("    campaign ÷ these", ratio("measured", f" (goal {GOAL})")),
        ("    independent processes, flights alone", per_s("flown")),
        ("    campaign ÷ these", ratio("flown")),
    ]
    for run in facts["memory"]:
        figure = f"{run['command_mb']:.0f} MB, {run['flier_mb']:.0f} MB each"
        rows.append((f"    memory at {run['cases']} cases: command, fliers", figure))
    return rows


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        facts = campaign_figures(Path(folder))
    for what, figure in campaign_rows(facts):
        print(f"{what:<44}{figure:>34}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, subprocess.SubprocessError) as error:
        sys.exit(f"bench: {error}")
