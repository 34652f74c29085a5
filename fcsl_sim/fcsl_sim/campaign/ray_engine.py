# SPDX-License-Identifier: Apache-2.0
"""Flies cases on a Ray cluster: the one that the environment names (RAY_ADDRESS), else one on this machine. The study, its models
and its machine are at the same paths on every node. A worker that is lost costs nothing: its cases are flown again.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from ..errors import SimError
from .flight import CRASHED, Flights, Outcome, not_flown
from .study import Study

_PORTION = 16
#: A case whose worker was lost so often is taken for one that ends it.
_TRIES = 3


class _Actor:
    """Lives in a worker."""

    def __init__(self, study: str, cases: int | None):
        self._flights = Flights.of(Path(study), cases)

    def fly(self, cases: list[int]) -> list[Outcome]:
        return [self._flights.fly(case) for case in cases]


def fly_on_ray(
    study: Study, cases: Iterator[int], jobs: int, given_cases: int | None, progress: Callable[[], None]
) -> Iterator[Outcome]:
    """As workers.fly_in_processes. Raises SimError without Ray, or if no worker can be started."""
    try:
        import ray
    except ImportError:
        raise SimError("`--engine ray` needs the Python package `ray`: python3 -m pip install ray") from None
    if not ray.is_initialized():
        local = {} if "RAY_ADDRESS" in os.environ else {"num_cpus": jobs, "_node_ip_address": "127.0.0.1"}
        ray.init(include_dashboard=False, log_to_driver=False, logging_level="ERROR", **local)
    cluster = _Cluster(ray, study, cases, given_cases)
    try:
        yield from cluster.fly(jobs, progress)
    finally:
        ray.shutdown()


class _Cluster:
    def __init__(self, ray: Any, study: Study, cases: Iterator[int], given_cases: int | None):
        self.ray, self.study, self.cases, self.given_cases = ray, study, cases, given_cases
        self.kind = ray.remote(_Actor)
        #: Portions to fly again, and how often each case of them was lost.
        self.again: list[list[int]] = []
        self.lost: dict[int, int] = {}
        #: By the result that is awaited: the worker, its cases, and when it got them.
        self.flying: dict[Any, tuple[Any, list[int], float]] = {}

    def fly(self, jobs: int, progress: Callable[[], None]) -> Iterator[Outcome]:
        for _ in range(jobs):
            self._hand_out(None)
        while self.flying:
            progress()
            done, _ = self.ray.wait(list(self.flying), timeout=0.5)
            for result in done:
                yield from self._take(result)
            for result in list(self.flying):
                yield from self._check_time(result)

    def _hand_out(self, actor: Any) -> None:
        portion = self.again.pop() if self.again else list(islice(self.cases, _PORTION))
        if portion:
            actor = actor or self.kind.remote(str(self.study.path.resolve()), self.given_cases)
            self.flying[actor.fly.remote(portion)] = actor, portion, time.monotonic()

    def _take(self, result: Any) -> Iterator[Outcome]:
        actor, portion, _ = self.flying.pop(result)
        try:
            outcomes = self.ray.get(result)
        except self.ray.exceptions.RayActorError:
            yield from self._lose(portion, CRASHED)
            self._hand_out(None)
            return
        except self.ray.exceptions.RayTaskError as error:
            raise SimError(f"a Ray worker cannot fly the study: {error.cause}") from None
        yield from outcomes
        self._hand_out(actor)

    def _check_time(self, result: Any) -> Iterator[Outcome]:
        actor, portion, since = self.flying[result]
        if time.monotonic() - since < self.study.timeout_s * len(portion):
            return
        del self.flying[result]
        self.ray.kill(actor)
        if len(portion) == 1:
            yield not_flown(self.study, portion[0], f"no result within {self.study.timeout_s:g} s (`timeout_s`)")
        else:
            self.again += [[case] for case in portion]
        self._hand_out(None)

    def _lose(self, portion: list[int], why: str) -> Iterator[Outcome]:
        """Cases are flown again by themselves; one that has lost several workers is what ends them."""
        for case in portion:
            self.lost[case] = self.lost.get(case, 0) + 1
            if len(portion) == 1 and self.lost[case] >= _TRIES:
                yield not_flown(self.study, case, why)
            else:
                self.again.append([case])
