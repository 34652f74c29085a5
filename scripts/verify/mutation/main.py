# SPDX-License-Identifier: Apache-2.0
"""Mutants: small changes of the C runtime, the compiler, the simulator and simclient, each of which some test must notice.

A seed draws mutants among all that could be made (operators, boundaries, constants, results, deleted statements). All are
compiled into one copy of the packages in out/verify/mutation, each behind a switch, so one build serves all. One run of all
tests notes which test reaches which mutant. Then every mutant is switched on and meets the tests that reach it, the shortest
first, until 120 s of them are spent: a test that fails, crashes or hangs kills it. A mutant that no test reaches has survived.
equivalent.toml lists mutants that no test can notice, and why; they are not drawn.

As a control, some runs go the same way with no mutant switched on, and must pass.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from ..shared.cases import OUT, CheckFailed, write_facts
from .mutants import Mutant, draw, equivalents
from .tests import Test, killer, record
from .tree import Tree, candidates, compiles

COUNT, SEED = 100, 1
#: The largest share of mutants that may survive, percent.
LIMIT_PERCENT = 10.0
#: Every so manieth mutant is also run without being switched on.
CONTROL_EVERY = 25
#: Of the normal distribution: 95 % lie within.
_Z = 1.96


def interval(survived: int, total: int) -> tuple[float, float]:
    """Wilson's interval of a share, 95 %."""
    share, z2 = survived / total, _Z * _Z / total
    middle = (share + z2 / 2) / (1 + z2)
    half = _Z * math.sqrt(share * (1 - share) / total + z2 / total / 4) / (1 + z2)
    return max(0.0, middle - half), min(1.0, middle + half)


def tested(tree: Tree, mutants: list[Mutant], tests: list[Test], workers: int) -> dict[Mutant, str | None]:
    """What killed each mutant, or None. Raises CheckFailed when a control fails."""
    environment = tree.environment()
    # In any order, so that the time left, and an interrupted run, mislead nobody.
    mutants = random.Random(SEED).sample(mutants, len(mutants))
    results: dict[Mutant, str | None] = {}
    begun = time.monotonic()
    false_alarms: list[str] = []
    pool = ThreadPoolExecutor(workers)
    try:
        futures = {pool.submit(killer, tree, environment, tests, m, True): (m, False) for m in mutants}
        futures |= {
            pool.submit(killer, tree, environment, tests, m, False): (m, True) for m in mutants[::CONTROL_EVERY]
        }
        for done, future in enumerate(as_completed(futures), 1):
            (mutant, is_control), by = futures[future], future.result()
            if is_control:
                false_alarms += [f"{mutant.file}: {by}"] if by is not None else []
                continue
            results[mutant] = by
            if by is None:
                reached = any(mutant.number in t.reaches for t in tests)
                print(f"survived{'' if reached else ' (not reached)'}: {mutant}", flush=True)
            if done % 10 == 0:
                left = (time.monotonic() - begun) / done * (len(futures) - done)
                alive = sum(by is None for by in results.values())
                print(f"{done} of {len(futures)} runs, {alive} survived, {left / 60:.0f} min left", flush=True)
    finally:
        pool.shutdown(cancel_futures=True)
    if false_alarms:
        raise CheckFailed("tests failed with no mutant switched on, so kills mean little: " + "; ".join(false_alarms))
    return results


def facts_of(results: dict[Mutant, str | None], tests: list[Test]) -> dict[str, Any]:
    """Counts and share of some mutants, and the survivors."""
    survivors = [m for m, by in results.items() if by is None]
    low, high = interval(len(survivors), len(results))
    return {
        "mutants": len(results),
        "killed": len(results) - len(survivors),
        "survived": len(survivors),
        "survived_percent": 100 * len(survivors) / len(results),
        "interval_percent": [100 * low, 100 * high],
        "survivors": [
            {
                "file": m.file,
                "line": m.point.line,
                "kind": m.point.kind,
                "before": m.point.before,
                "after": m.point.after,
                "reached": any(m.number in t.reaches for t in tests),
            }
            for m in sorted(survivors, key=lambda m: m.number)
        ],
    }


def report(facts: dict[str, dict[str, Any]]) -> Iterable[str]:
    for package, f in facts.items():
        low, high = f["interval_percent"]
        yield (
            f"{package}: {f['mutants']} mutants of {f['candidates']}, {f['killed']} killed, {f['survived']} survived: "
            f"{f['survived_percent']:.1f} % (95 % interval {low:.1f} to {high:.1f})"
        )
        for s in f["survivors"]:
            where = "" if s["reached"] else ", not reached"
            yield f"    {s['file']}:{s['line']}: {s['kind']}{where}: {s['before']} → {s['after'] or 'nothing'}"


def check(count: int, seed: int, only: str, workers: int) -> dict[str, dict[str, Any]]:
    """Figures by package, then of all. Raises CheckFailed."""
    every = candidates(only)
    print(f"drawing {count} mutants of {len(every)} ...", flush=True)
    chosen = draw(every, count, seed, compiles)
    if not chosen:
        raise CheckFailed(f"no mutant in a source that holds `{only}` in its path")
    for m in chosen:
        print(f"    {m}")
    tree = Tree(OUT / "mutation")
    print(f"building them in {tree.folder} ...", flush=True)
    tree.make(chosen)
    print("running every test once, to see what it reaches ...", flush=True)
    tests = record(tree, tree.environment(), workers)
    print(f"{len(tests)} tests pass without a mutant", flush=True)
    results = tested(tree, chosen, tests, workers)
    facts: dict[str, dict[str, Any]] = {}
    for package in (*sorted({m.file.split("/")[0] for m in chosen}), ""):
        of_package = {m: by for m, by in results.items() if m.file.startswith(package)}
        possible = sum(c.file.startswith(package) for c in every)
        facts[package or "all"] = {"candidates": possible, **facts_of(of_package, tests if package else [])}
    return facts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=COUNT, help="how many mutants (default %(default)s)")
    parser.add_argument("--seed", type=int, default=SEED, help="other mutants (default %(default)s)")
    parser.add_argument("--only", default="", metavar="WORDS", help="files whose path holds this")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="tests at a time (default: all cores)")
    options = parser.parse_args()
    begun = time.monotonic()
    try:
        facts = check(options.count, options.seed, options.only, options.workers)
    except CheckFailed as error:
        print(f"mutation: {error}", file=sys.stderr)
        return 1
    total = facts.pop("all")
    print("\n".join(report(facts)))
    percent, (low, high) = total["survived_percent"], total["interval_percent"]
    seconds = round(time.monotonic() - begun)
    equivalent = len(equivalents())
    print(
        f"{total['survived']} of {total['mutants']} survived, {percent:.1f} % (95 % interval {low:.1f} to {high:.1f}; "
        f"limit {LIMIT_PERCENT:.0f}); {equivalent} known equivalents; {seconds} s"
    )
    settings = {"count": options.count, "seed": options.seed, "only": options.only, "seconds": seconds}
    write_facts("mutation", {**settings, "equivalent": equivalent, "survived_percent": percent, "packages": facts})
    return 0 if percent <= LIMIT_PERCENT else 1


if __name__ == "__main__":
    sys.exit(main())
