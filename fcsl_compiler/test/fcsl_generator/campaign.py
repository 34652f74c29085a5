# SPDX-License-Identifier: Apache-2.0
"""Runs many generated cases: Hypothesis generates them from seeds; they are checked in batches on all cores and shrunk
on failure."""

from __future__ import annotations

import multiprocessing
import os
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from .harness import check
from .machines import Case

#: Machines per library: enough to amortise the start of a C compiler, few enough to use all cores.
BATCH = 16


def explore(strategy: st.SearchStrategy[Case], number: int, receive: Callable[[Case], None]) -> None:
    """Passes the case of a seed number to `receive`. If it raises, also passes the smaller cases that Hypothesis tries.

    One Hypothesis run generates two examples: the minimal one, which is skipped, and a random one. Further ones would
    be variations of it, so one run per case finds more.
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


def generate(strategy: st.SearchStrategy[Case], count: int, number: int, first: int = 0) -> list[Case]:
    """`count` cases, reproducible from the seed number."""
    found: list[Case] = []
    for n in range(first, first + count):
        explore(strategy, _seed(number, n), found.append)
    return found


def _seed(number: int, n: int) -> int:
    return number * 1_000_000 + n


#: Returns a description of the failure for each case, "" if it passes.
Check = Callable[[Sequence[Case]], list[str]]


def campaign(strategy: st.SearchStrategy[Case], count: int, number: int, check: Check = check) -> None:
    """Checks `count` cases. Raises AssertionError with a minimal failing case, the difference and the command to repeat
    it."""
    found = _first_failure(strategy, count, number, check)
    if found is None:
        return
    failed, killed = found

    def again(case: Case) -> None:
        problem = _apart(case, check) if killed else check([case])[0]
        if problem:
            raise _kind(problem)(f"{problem}\n\n{case}")

    explore(strategy, _seed(number, failed), again)
    raise AssertionError(f"case {failed} of seed {number} failed in a batch and not alone")


def _first_failure(strategy: st.SearchStrategy[Case], count: int, number: int, check: Check) -> tuple[int, bool] | None:
    """The first failing case, and whether it crashed its process. Batches are generated and checked on all cores."""

    def batch(at: int) -> list[str]:
        cases: list[Case] = []
        for n in range(at, min(at + BATCH, count)):
            explore(strategy, _seed(number, n), cases.append)
        return check(cases)

    done = 0
    with _pool(os.cpu_count() or 1, batch) as pool:
        jobs = {pool.submit(_work, at): at for at in range(0, count, BATCH)}
        for job in as_completed(jobs):
            at = jobs[job]
            try:
                problems, killed = job.result(), False
            except BrokenProcessPool:
                cases = generate(strategy, min(BATCH, count - at), number, at)
                problems, killed = [_apart(case, check) for case in cases], True
            failed = next((n for n, problem in enumerate(problems) if problem), None)
            if failed is not None:
                for other in jobs:
                    other.cancel()
                return at + failed, killed
            done += len(problems)
            print(f"{done} of {count} generated machines agree", flush=True)
    return None


_job: Callable[[Any], Any]


def _begin(job: Callable[[Any], Any]) -> None:
    """Sets the arguments of a worker. Workers are forked, so the arguments are not pickled."""
    global _job
    _job = job


def _work(argument: Any) -> Any:
    return _job(argument)


def _pool(workers: int, job: Callable[[Any], Any]) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("fork"), _begin, (job,))


def _apart(case: Case, check: Check) -> str:
    """Checks a case in a separate process, because it may crash."""
    with _pool(1, check) as pool:
        try:
            return str(pool.submit(_work, [case]).result()[0])
        except BrokenProcessPool:
            return "the process was killed"


@cache
def _named(name: str) -> type[AssertionError]:
    return type(name, (AssertionError,), {})


def _kind(problem: str) -> type[AssertionError]:
    """Kind of failure: what differs, or the code of a diagnostic. Shrinking keeps the kind."""
    code = re.search(r"error\[(E\d+)\]", problem)
    if code:
        return _named(f"Refused{code[1]}")
    return _named("DiffersFromOracle" if ", oracle " in problem else "DiffersFromCPython")
