# SPDX-License-Identifier: Apache-2.0
"""Flies cases in several processes. A model that crashes or hangs costs its own case and nothing else."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from tempfile import TemporaryFile
from typing import IO

from ..errors import SimError
from .flight import CRASHED, Flight, Outcome, not_flown
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
    flights: list[Flight] = field(default_factory=list)  # handed out, without a result yet
    since: float = field(default_factory=time.monotonic)  # the case in flight began, or the process


class Pool:
    """Processes that wait for flights. A context manager: its end is theirs."""

    def __init__(self, study: Study, jobs: int, given_cases: int | None):
        self.study, self.jobs, self.given_cases = study, jobs, given_cases
        self.selector = selectors.DefaultSelector()
        self.workers: list[_Worker] = []
        self.portion = 1
        self.flights: Iterator[Flight] | None = None  # None: all are handed out
        self.pending: list[Flight] = []  # taken from `flights`, not handed out
        self.alone: list[Flight] = []  # to be flown one by one: one of them has ended a process

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in list(self.workers):
            if worker.flights or not worker.ready:
                worker.process.kill()
            self._forget(worker)
        self.selector.close()

    def fly(self, flights: Iterable[Flight], progress: Callable[[], None]) -> Iterator[tuple[Flight, Outcome]]:
        """As engine.py says."""
        self.flights = iter(flights)
        for worker in self.workers:
            if worker.ready:
                self._hand_out(worker)
        while len(self.workers) < self.jobs:
            self._start()
        while self.flights or self.pending or self.alone or any(worker.flights for worker in self.workers):
            progress()
            if not self.workers:
                self._start()
            for key, _ in self.selector.select(timeout=0.5):
                yield from self._read(key.data)
            for worker in list(self.workers):
                yield from self._check_time(worker)

    # ---- processes --------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        results, theirs = os.pipe()
        cases = "-" if self.given_cases is None else str(self.given_cases)
        study = str(self.study.path), cases, self.study.parameter_file
        line = [sys.executable, "-m", "fcsl_sim.campaign.worker", *study, str(theirs)]
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

    # ---- flights --------------------------------------------------------------------------------------------------------

    def _hand_out(self, worker: _Worker) -> None:
        """The next portion, before the last one is flown."""
        if worker.flights and (self.alone or worker.alone or len(worker.flights) > self.portion // 2):
            return
        portion = [self.alone.pop()] if self.alone else self._next_portion()
        if not portion:
            return
        worker.alone = len(portion) == 1
        assert worker.process.stdin
        with suppress(BrokenPipeError):  # it has crashed: its pipe of results ends, too
            worker.since = worker.since if worker.flights else time.monotonic()
            worker.flights += portion
            line = json.dumps([portion[0].case, len(portion), portion[0].gains])
            worker.process.stdin.write(f"{line}\n".encode())
            worker.process.stdin.flush()

    def _next_portion(self) -> list[Flight]:
        """Cases in a row, with the same gains."""
        found: list[Flight] = []
        while len(found) < self.portion:
            flight = self.pending.pop() if self.pending else self._next()
            if flight is None:
                break
            if found and flight != Flight(found[-1].case + 1, found[-1].gains):
                self.pending.append(flight)
                break
            found.append(flight)
        return found

    def _next(self) -> Flight | None:
        flight = next(self.flights, None) if self.flights else None
        if flight is None:
            self.flights = None
        return flight

    def _read(self, worker: _Worker) -> Iterator[tuple[Flight, Outcome]]:
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
            assert worker.flights and worker.flights[0].case == outcome.case
            done += 1
            yield worker.flights.pop(0), outcome
        if done:
            self._adapt((now - worker.since) / done)
            worker.since = now
            self._hand_out(worker)

    def _adapt(self, took_s: float) -> None:
        wanted = int(_PORTION_S / max(took_s, 1e-6))
        self.portion = max(1, min(_MAX_PORTION, wanted, 2 * self.portion))

    def _ended(self, worker: _Worker) -> Iterator[tuple[Flight, Outcome]]:
        words = self._forget(worker).decode("utf-8", "replace").strip()
        if not worker.ready:
            raise SimError(
                words.removeprefix("fcsl-sim: error: ") or "a process for flights ended before its first one"
            )
        if worker.flights:
            yield from self._lost(worker, CRASHED)

    def _check_time(self, worker: _Worker) -> Iterator[tuple[Flight, Outcome]]:
        limit = self.study.timeout_s if worker.ready else _START_S
        if time.monotonic() - worker.since < limit or (worker.ready and not worker.flights):
            return
        worker.process.kill()
        self._forget(worker)
        if not worker.ready:
            raise SimError(f"a process for flights is not ready after {_START_S:g} s")
        yield from self._lost(worker, f"no result within {limit:g} s (`timeout_s`)")

    def _lost(self, worker: _Worker, why: str) -> Iterator[tuple[Flight, Outcome]]:
        """A case by itself is what ended the process. Others are flown one by one to find it."""
        self._start()
        if len(worker.flights) == 1:
            yield worker.flights[0], not_flown(self.study, worker.flights[0].case, why)
        else:
            self.alone += reversed(worker.flights)
