# SPDX-License-Identifier: Apache-2.0
"""Who flies: processes of this machine, or a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Protocol

from .flight import Flight, Outcome
from .study import Study


class Engine(Protocol):
    """workers.py, ray_engine.py"""

    def fly(self, flights: Iterable[Flight], progress: Callable[[], None]) -> Iterator[tuple[Flight, Outcome]]:
        """The flights with their outcomes, as they come. `progress` is called at least twice a second. Raises SimError if none
        can be flown."""


def open_engine(name: str, study: Study, jobs: int, given_cases: int | None = None) -> AbstractContextManager[Engine]:
    """name: `local` or `ray`. given_cases: in place of the study's. The end of the context is that of its workers. Raises
    SimError."""
    if name == "ray":
        from .ray_engine import Cluster  # an extra, so imported only when asked for

        return Cluster(study, jobs, given_cases)
    from .workers import Pool

    return Pool(study, jobs, given_cases)
