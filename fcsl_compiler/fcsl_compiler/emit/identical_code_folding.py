# SPDX-License-Identifier: Apache-2.0
"""Identical code folding: finds instances that can share a record and the code of `execute`."""

from __future__ import annotations

from ..model.machine import Machine


def first_identical(machine: Machine, quiet: frozenset[int]) -> tuple[int, ...]:
    """For each instance of a lowered machine the first one with an equal record and an equal `execute`, often itself.
    Their parameters may differ, unless they are frozen. `quiet`: see status_elision.py."""
    first: dict[tuple[str | bool, ...], int] = {}
    return tuple(
        first.setdefault(
            (i.algorithm.name, i.execute.name, n in quiet, n in machine.last_runs, n in machine.completed), n
        )
        for n, i in enumerate(machine.instances)
    )
