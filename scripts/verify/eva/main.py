# SPDX-License-Identifier: Apache-2.0
"""No run-time error: Frama-C's EVA on the C of every example, of every block and of generated machines, under a host that may do anything.

    python3 scripts/verify eva [--machines N] [--seed S] [--jobs J] [--keep FOLDER]

EVA follows every path of `init`, then endlessly { any host writes, any forced state, step }, with intervals of values. What
it cannot exclude it reports as an alarm; there must be none. Before that, controls: machines with a seeded defect, each of
which it must find, else the check is worth nothing.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..shared import cases
from ..shared.effort import scaled
from .control import controls
from .run import Analysis, Subject, analyse
from .subjects import blocks, examples, generated

#: More of one kind than this are counted, not shown.
SHOWN = 12


def main() -> int:
    options = _options()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="fcsl-eva-") as scratch:
        folder = Path(options.keep or scratch)
        try:
            found = _controls(folder, options.jobs)
            subjects = [*examples(folder), blocks(folder), *generated(folder, options.machines, options.seed)]
            rows = list(_progress(subjects, options.jobs))
        except cases.CheckFailed as failed:
            print(f"eva: {failed}", file=sys.stderr)
            return 1
    _table(rows)
    seconds = time.monotonic() - started
    problems = [problem for row in rows for problem in row.problems]
    facts = {
        "machines": len(rows),
        "lines": sum(row.lines for row in rows),
        "functions": sum(row.functions for row in rows),
        "statements": sum(row.statements for row in rows),
        "statements_reached": sum(row.reached for row in rows),
        "functions_unreached": sum(len(row.unreached) for row in rows),
        "alarms": sum(row.alarms for row in rows),
        "controls_found": found,
        "seconds": round(seconds, 1),
        "cpu_seconds": round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, 1),
        "rows": [row.facts() for row in rows],
    }
    cases.write_facts("eva", facts)
    print("\n".join(f"{name:20} {value}" for name, value in facts.items() if name != "rows"))
    for problem in problems[:SHOWN]:
        print(f"eva: {problem}", file=sys.stderr)
    if len(problems) > SHOWN:
        print(f"eva: and {len(problems) - SHOWN} more", file=sys.stderr)
    return 1 if problems else 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--machines", type=int, default=scaled(25, 500), help="how many generated machines (default 25, or 500)"
    )
    parser.add_argument("--seed", type=int, default=7, help="which ones: the same for the same number (default 7)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="analyses at once (default: every core)")
    parser.add_argument("--keep", metavar="FOLDER", help="leave sources and EVA's logs there")
    return parser.parse_args()


def _controls(folder: Path, jobs: int) -> int:
    """How many seeded defects EVA found. Raises CheckFailed where it missed one, or where the control itself fails."""
    sound, *seeded = controls(folder)
    with ThreadPoolExecutor(jobs) as pool:
        clean, *defective = pool.map(analyse, [sound.subject, *(control.subject for control in seeded)])
    if clean.problems:
        raise cases.CheckFailed(f"the control without a defect: {clean.problems[0]}")
    for control, analysis in zip(seeded, defective, strict=True):
        told = next((problem for problem in analysis.problems if control.word in problem), None)
        if told is None:
            raise cases.CheckFailed(
                f"EVA missed the seeded defect `{control.name}`: it said {analysis.problems or 'nothing'}"
            )
        print(f"control: {control.name}: found: {told}", flush=True)
    return len(seeded)


def _progress(subjects: Iterable[Subject], jobs: int) -> Iterator[Analysis]:
    """Analyses in the order of the subjects, with a line as each ends."""
    subjects = list(subjects)
    with ThreadPoolExecutor(jobs) as pool:
        for n, analysis in enumerate(pool.map(analyse, subjects), 1):
            print(
                f"{n} of {len(subjects)}: {analysis.name}: {analysis.alarms} alarms, {analysis.seconds:.1f} s",
                flush=True,
            )
            yield analysis


def _table(rows: list[Analysis]) -> None:
    print(
        f"\n{'machine':16} {'lines':>6} {'functions':>9} {'unreached':>9} {'statements':>12} {'alarms':>6} {'seconds':>7}"
    )
    for row in rows:
        statements = f"{row.reached}/{row.statements}"
        print(
            f"{row.name:16} {row.lines:6} {row.functions:9} {len(row.unreached):9} {statements:>12} {row.alarms:6} {row.seconds:7.1f}"
        )
    print()


if __name__ == "__main__":
    sys.exit(main())
