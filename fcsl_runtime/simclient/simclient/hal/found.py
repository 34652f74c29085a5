# SPDX-License-Identifier: Apache-2.0
"""A sensor or an actuator that sysfs shows, and how drivers would call it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Candidate:
    """A driver that may take a device. `device`: the text for board.json; `probed`: that to probe with, if it is another."""

    driver: str
    device: str
    probed: str = ""


@dataclass(frozen=True)
class Found:
    """`why`: why there are no candidates, if there are none."""

    kind: str
    name: str
    path: str
    measures: list[str] = field(default_factory=list)
    candidates: list[Candidate] = field(default_factory=list)
    why: str = ""


def first_unique(names: Iterable[str], of_all: Iterable[Iterable[str]]) -> str:
    """The first name that only one of the lists `of_all` holds; "" without one."""
    lists = [set(others) for others in of_all]
    return next((name for name in names if name and sum(name in others for others in lists) == 1), "")
