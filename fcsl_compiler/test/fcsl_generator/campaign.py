# SPDX-License-Identifier: Apache-2.0
"""Many generated cases: made by Hypothesis from seeds, checked in batches on every core, shrunk when one fails."""

from __future__ import annotations

import multiprocessing
import os
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import cache

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .harness import check
from .machines import Case

#: Machines in one library: enough to share the start of a C compiler, few enough to keep every core busy.
BATCH = 16


def explore(strategy: st.SearchStrategy[Case], number: int, receive: Callable[[Case], None]) -> None:
    """Hands `receive` the case of a seed number; if it raises, then also the smaller ones that Hypothesis tries.

    One run makes two examples: the smallest there is, which is left out, and a random one. Further ones would be variations
    of it: one run for each case finds more.
    """
    calls = 0

    @seed(number)
    @settings(
        max_examples=2,
        phases=(Phase.generate, Phase.shrink),
        database=None,
        deadline=None,
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def run(case: Case) -> None:
        nonlocal calls
        calls += 1
        if calls > 1:
            receive(case)

    run()


def generate(strategy: st.SearchStrategy[Case], count: int, number: int) -> list[Case]:
    """`count` cases, always the same ones for the same seed number."""
    found: list[Case] = []
    for n in range(count):
        explore(strategy, _seed(number, n), found.append)
    return found


def _seed(number: int, n: int) -> int:
    return number * 1_000_000 + n


#: Says what is wrong with each case, "" where nothing is.
Check = Callable[[Sequence[Case]], list[str]]


def campaign(strategy: st.SearchStrategy[Case], count: int, number: int, check: Check = check) -> None:
    """Checks `count` cases; raises AssertionError with a minimal one that fails, what differs and how to repeat it."""
    cases = generate(strategy, count, number)
    found = _first_failure(cases, check)
    if found is None:
        return
    failed, killed = found

    def again(case: Case) -> None:
        problem = _apart(case, check) if killed else check([case])[0]
        if problem:
            raise _kind(problem)(f"{problem}\n\n{case}")

    explore(strategy, _seed(number, failed), again)
    raise AssertionError(f"case {failed} of seed {number} failed in a batch and not alone:\n\n{cases[failed]}")


def _first_failure(cases: list[Case], check: Check) -> tuple[int, bool] | None:
    """Index of a case that fails, and whether it took its process down. After a failure no more batches are begun."""
    workers, done = os.cpu_count() or 1, 0
    with _pool(workers) as pool:
        jobs = {pool.submit(check, cases[at : at + BATCH]): at for at in range(0, len(cases), BATCH)}
        for job in as_completed(jobs):
            at, batch = jobs[job], cases[jobs[job] : jobs[job] + BATCH]
            try:
                problems, killed = job.result(), False
            except BrokenProcessPool:
                problems, killed = [_apart(case, check) for case in batch], True
            failed = next((n for n, problem in enumerate(problems) if problem), None)
            if failed is not None:
                for other in jobs:
                    other.cancel()
                return at + failed, killed
            done += len(batch)
            print(f"{done} of {len(cases)} generated machines agree", flush=True)
    return None


def _pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("fork"))


def _apart(case: Case, check: Check) -> str:
    """In a process of its own, which the case may take down."""
    with _pool(1) as pool:
        try:
            return pool.submit(check, [case]).result()[0]
        except BrokenProcessPool:
            return "the process was killed"


@cache
def _named(name: str) -> type[AssertionError]:
    return type(name, (AssertionError,), {})


def _kind(problem: str) -> type[AssertionError]:
    """Shrinking keeps to one kind of failure: what disagrees, or the code of a refusal."""
    code = re.search(r"error\[(E\d+)\]", problem)
    if code:
        return _named(f"Refused{code[1]}")
    return _named("DiffersFromOracle" if ", oracle " in problem else "DiffersFromCPython")
