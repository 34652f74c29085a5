# SPDX-License-Identifier: Apache-2.0
"""Flies cases in several processes. A model that crashes or hangs costs its own case and nothing else."""

from __future__ import annotations

import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from ..errors import SimError
from .flight import CRASHED, Outcome, not_flown
from .study import Study
from .worker import READY, outcome_of

#: What a worker gets at a time takes about so long, s.
_PORTION_S = 0.2
_MAX_PORTION = 256
#: To load study, models and machine, s.
_START_S = 600.0
_READ_BYTES = 1 << 16


@dataclass
class _Worker:
    process: subprocess.Popen[bytes]
    results: int
    text: bytes = b""
    ready: bool = False
    cases: list[int] = field(default_factory=list)  # handed out, without a result yet
    since: float = field(default_factory=time.monotonic)  # the case in flight began, or the process


def fly_in_processes(
    study: Study, cases: Iterator[int], jobs: int, given_cases: int | None, progress: Callable[[], None]
) -> Iterator[Outcome]:
    """The outcomes of the cases, as they come. `progress` is called at least twice a second. Closing it ends the processes.
    Raises SimError if no process can be started."""
    pool = _Pool(study, cases, given_cases)
    try:
        yield from pool.fly(jobs, progress)
    finally:
        pool.close()


class _Pool:
    def __init__(self, study: Study, cases: Iterator[int], given_cases: int | None):
        self.study, self.cases, self.given_cases = study, cases, given_cases
        self.selector = selectors.DefaultSelector()
        self.workers: list[_Worker] = []
        self.portion = 1
        self.pending: list[int] = []  # taken from `cases`, not handed out

    def fly(self, jobs: int, progress: Callable[[], None]) -> Iterator[Outcome]:
        for _ in range(jobs):
            self._start()
        while self.workers:
            progress()
            for key, _ in self.selector.select(timeout=0.5):
                yield from self._read(key.data)
            for worker in list(self.workers):
                yield from self._check_time(worker)

    def close(self) -> None:
        for worker in list(self.workers):
            worker.process.kill()
            self._forget(worker)

    # ---- processes --------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        results, theirs = os.pipe()
        cases = "-" if self.given_cases is None else str(self.given_cases)
        line = [sys.executable, "-m", "fcsl_sim.campaign.worker", str(self.study.path), cases, str(theirs)]
        try:
            process = subprocess.Popen(
                line, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, pass_fds=[theirs]
            )
        except OSError as error:
            os.close(results)
            raise SimError(f"no process for flights: {error.strerror}") from None
        finally:
            os.close(theirs)
        worker = _Worker(process, results)
        self.workers.append(worker)
        self.selector.register(results, selectors.EVENT_READ, worker)

    def _forget(self, worker: _Worker) -> bytes:
        """Its last words on standard error. It has ended, or was killed."""
        self.workers.remove(worker)
        self.selector.unregister(worker.results)
        os.close(worker.results)
        process = worker.process
        assert process.stdin and process.stderr
        with suppress(BrokenPipeError):
            process.stdin.close()
        words = process.stderr.read()
        process.stderr.close()
        process.wait()
        return words

    # ---- cases --------------------------------------------------------------------------------------------------------

    def _hand_out(self, worker: _Worker) -> None:
        """The next portion, or the end of the work."""
        portion = self._next_portion()
        assert worker.process.stdin
        with suppress(BrokenPipeError):  # it has crashed: its pipe of results ends, too
            if portion:
                worker.cases, worker.since = portion, time.monotonic()
                worker.process.stdin.write(f"{portion[0]} {len(portion)}\n".encode())
                worker.process.stdin.flush()
            else:
                worker.process.stdin.close()

    def _next_portion(self) -> list[int]:
        """Cases in a row."""
        found: list[int] = []
        while len(found) < self.portion:
            case = self.pending.pop() if self.pending else next(self.cases, None)
            if case is None:
                break
            if found and case != found[-1] + 1:
                self.pending.append(case)
                break
            found.append(case)
        return found

    def _read(self, worker: _Worker) -> Iterator[Outcome]:
        data = os.read(worker.results, _READ_BYTES)
        if not data:
            yield from self._ended(worker)
            return
        *lines, worker.text = (worker.text + data).split(b"\n")
        for line in lines:
            now = time.monotonic()
            if not worker.ready:
                assert line.decode() == READY
                worker.ready = True
                self._hand_out(worker)
                continue
            outcome = outcome_of(line.decode())
            assert worker.cases and worker.cases[0] == outcome.case
            worker.cases.pop(0)
            self._adapt(now - worker.since)
            worker.since = now
            yield outcome
            if not worker.cases:
                self._hand_out(worker)

    def _adapt(self, took_s: float) -> None:
        wanted = int(_PORTION_S / max(took_s, 1e-6))
        self.portion = max(1, min(_MAX_PORTION, wanted, 2 * self.portion))

    def _ended(self, worker: _Worker) -> Iterator[Outcome]:
        words = self._forget(worker).decode("utf-8", "replace").strip()
        if not worker.ready:
            raise SimError(
                words.removeprefix("fcsl-sim: error: ") or "a process for flights ended before its first one"
            )
        if worker.cases:
            yield self._lost(worker, CRASHED)

    def _check_time(self, worker: _Worker) -> Iterator[Outcome]:
        limit = self.study.timeout_s if worker.ready else _START_S
        if time.monotonic() - worker.since < limit or (worker.ready and not worker.cases):
            return
        worker.process.kill()
        self._forget(worker)
        if not worker.ready:
            raise SimError(f"a process for flights is not ready after {_START_S:g} s")
        yield self._lost(worker, f"no result within {limit:g} s (`timeout_s`)")

    def _lost(self, worker: _Worker, why: str) -> Outcome:
        """Of the case in flight; another process goes on with those behind it."""
        case, *rest = worker.cases
        self.pending.extend(reversed(rest))
        self._start()
        return not_flown(self.study, case, why)
