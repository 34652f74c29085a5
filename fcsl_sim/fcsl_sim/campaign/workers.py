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
from tempfile import TemporaryFile
from typing import IO

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
_WORDS_BYTES = 1 << 14


@dataclass
class _Worker:
    process: subprocess.Popen[bytes]
    results: int
    words: IO[bytes]  # on standard error
    text: bytes = b""
    ready: bool = False
    alone: bool = False  # the last portion is one case
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
        self.alone: list[int] = []  # to be flown one by one: one of them has ended a process

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
        words = TemporaryFile()  # a pipe would fill, and a model that prints much would wait for ever
        try:
            process = subprocess.Popen(
                line, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=words, pass_fds=[theirs]
            )
        except OSError as error:
            os.close(results)
            raise SimError(f"no process for flights: {error.strerror}") from None
        finally:
            os.close(theirs)
        worker = _Worker(process, results, words)
        self.workers.append(worker)
        self.selector.register(results, selectors.EVENT_READ, worker)

    def _forget(self, worker: _Worker) -> bytes:
        """Its words on standard error. It has ended, or was killed."""
        self.workers.remove(worker)
        self.selector.unregister(worker.results)
        os.close(worker.results)
        process = worker.process
        assert process.stdin
        with suppress(BrokenPipeError):
            process.stdin.close()
        process.wait()
        worker.words.seek(0)
        with worker.words:
            return worker.words.read(_WORDS_BYTES)

    # ---- cases --------------------------------------------------------------------------------------------------------

    def _hand_out(self, worker: _Worker) -> None:
        """The next portion, before the last one is flown; or the end of the work."""
        if worker.cases and (self.alone or worker.alone or len(worker.cases) > self.portion // 2):
            return
        portion = [self.alone.pop()] if self.alone else self._next_portion()
        worker.alone = len(portion) == 1
        assert worker.process.stdin
        with suppress(BrokenPipeError):  # it has crashed: its pipe of results ends, too
            if portion:
                worker.since = worker.since if worker.cases else time.monotonic()
                worker.cases += portion
                worker.process.stdin.write(f"{portion[0]} {len(portion)}\n".encode())
                worker.process.stdin.flush()
            elif not worker.cases:
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
        now, done = time.monotonic(), 0
        for line in lines:
            if not worker.ready:
                assert line.decode() == READY
                worker.ready = True
                self._hand_out(worker)
                continue
            outcome = outcome_of(line.decode())
            assert worker.cases and worker.cases[0] == outcome.case
            worker.cases.pop(0)
            done += 1
            yield outcome
        if done:
            self._adapt((now - worker.since) / done)
            worker.since = now
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
            yield from self._lost(worker, CRASHED)

    def _check_time(self, worker: _Worker) -> Iterator[Outcome]:
        limit = self.study.timeout_s if worker.ready else _START_S
        if time.monotonic() - worker.since < limit or (worker.ready and not worker.cases):
            return
        worker.process.kill()
        self._forget(worker)
        if not worker.ready:
            raise SimError(f"a process for flights is not ready after {_START_S:g} s")
        yield from self._lost(worker, f"no result within {limit:g} s (`timeout_s`)")

    def _lost(self, worker: _Worker, why: str) -> Iterator[Outcome]:
        """A case by itself is what ended the process. Others are flown one by one to find it."""
        self._start()
        if len(worker.cases) == 1:
            yield not_flown(self.study, worker.cases[0], why)
        else:
            self.alone += reversed(worker.cases)
