# SPDX-License-Identifier: Apache-2.0
"""Flies cases on a Ray cluster: the one that the environment names (RAY_ADDRESS), else one on this machine. The study, its models
and its machine are at the same paths on every node. A worker that is lost costs nothing: its cases are flown again.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from simclient.parameters import Parameters

from ..errors import SimError
from .flight import CRASHED, Flight, Flights, Outcome, not_flown
from .study import Study

_PORTION = 16
#: A case whose worker was lost so often is taken for one that ends it.
_TRIES = 3


class _Actor:
    """Lives in a worker."""

    def __init__(self, study: str, cases: int | None, parameters: Parameters | None):
        self._flights = Flights.of(Path(study), cases, parameters)

    def fly(self, portion: list[Flight]) -> list[Outcome]:
        return [self._flights.fly(flight.case, gains=flight.gains) for flight in portion]


class Cluster:
    """As workers.Pool, on Ray."""

    def __init__(self, study: Study, jobs: int, given_cases: int | None):
        """Raises SimError without Ray."""
        try:
            import ray
        except ImportError:
            raise SimError("`--engine ray` needs the Python package `ray`: python3 -m pip install ray") from None
        if not ray.is_initialized():
            local = {} if "RAY_ADDRESS" in os.environ else {"num_cpus": jobs, "_node_ip_address": "127.0.0.1"}
            ray.init(include_dashboard=False, log_to_driver=False, logging_level="ERROR", **local)
        self.ray: Any = ray
        self.study, self.jobs, self.given_cases = study, jobs, given_cases
        self.kind = ray.remote(_Actor)
        self.flights: Iterator[Flight] = iter(())
        #: Workers without work.
        self.idle: list[Any] = []
        #: Portions to fly again, and how often each flight of them was lost.
        self.again: list[list[Flight]] = []
        self.lost: dict[Flight, int] = {}
        #: By the result that is awaited: the worker, its flights, and when it got them.
        self.flying: dict[Any, tuple[Any, list[Flight], float]] = {}

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.ray.shutdown()

    def fly(self, flights: Iterable[Flight], progress: Callable[[], None]) -> Iterator[tuple[Flight, Outcome]]:
        """As engine.py says."""
        self.flights = iter(flights)
        idle, self.idle = self.idle, []
        for number in range(self.jobs):
            self._hand_out(idle[number] if number < len(idle) else None)
        while self.flying:
            progress()
            done, _ = self.ray.wait(list(self.flying), timeout=0.5)
            for result in done:
                yield from self._take(result)
            for result in list(self.flying):
                yield from self._check_time(result)

    def _hand_out(self, actor: Any) -> None:
        portion = self.again.pop() if self.again else list(islice(self.flights, _PORTION))
        if portion:
            given = self.study.config.plan.parameters
            actor = actor or self.kind.remote(str(self.study.path.resolve()), self.given_cases, given)
            self.flying[actor.fly.remote(portion)] = actor, portion, time.monotonic()
        elif actor:
            self.idle.append(actor)

    def _take(self, result: Any) -> Iterator[tuple[Flight, Outcome]]:
        actor, portion, _ = self.flying.pop(result)
        try:
            outcomes = self.ray.get(result)
        except self.ray.exceptions.RayActorError:
            yield from self._lose(portion, CRASHED)
            self._hand_out(None)
            return
        except self.ray.exceptions.RayTaskError as error:
            raise SimError(f"a Ray worker cannot fly the study: {error.cause}") from None
        yield from zip(portion, outcomes, strict=True)
        self._hand_out(actor)

    def _check_time(self, result: Any) -> Iterator[tuple[Flight, Outcome]]:
        actor, portion, since = self.flying[result]
        if time.monotonic() - since < self.study.timeout_s * len(portion):
            return
        del self.flying[result]
        self.ray.kill(actor)
        if len(portion) == 1:
            why = f"no result within {self.study.timeout_s:g} s (`timeout_s`)"
            yield portion[0], not_flown(self.study, portion[0].case, why)
        else:
            self.again += [[flight] for flight in portion]
        self._hand_out(None)

    def _lose(self, portion: list[Flight], why: str) -> Iterator[tuple[Flight, Outcome]]:
        """Flights are flown again by themselves; one that has lost several workers is what ends them."""
        for flight in portion:
            self.lost[flight] = self.lost.get(flight, 0) + 1
            if len(portion) == 1 and self.lost[flight] >= _TRIES:
                yield flight, not_flown(self.study, flight.case, why)
            else:
                self.again.append([flight])
