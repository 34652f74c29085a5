# SPDX-License-Identifier: Apache-2.0
"""A requirement as data: read and checked."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.source import Span
from ..expression.tree import Node

#: What a requirement says of its condition; the key that holds it.
KINDS = ("then", "never", "at_end")

#: Longest time of a window, in ticks. `max_over` and `min_over` keep a value for each tick of it.
WINDOW_MAX = 4096
#: Requirements of a machine, and values that the code of one reads.
REQUIREMENTS_MAX = 256
VALUES_MAX = 1024
#: Of `held`, `within` and `within_s`, which keep ticks alone.
TICKS_MAX = 2**40


@dataclass(frozen=True)
class Requirement:
    """`within_ticks`: for so long `when` may hold without `then`. `clock`: the instance after whose completed runs it is
    evaluated (None: in every tick). `hold`: stale instances do not interrupt it. `assumed`: it is about the environment."""

    id: str
    text: str
    kind: str  # of KINDS
    when: Node | None
    condition: Node
    within_ticks: int
    clock: str | None
    hold: bool
    assumed: bool
    target: str  # the instance that a violation fails or degrades; "": none
    health: int  # the least health that it then has
    span: Span

    @property
    def instance(self) -> str:
        """Its name among the instances of the monitor."""
        return instance_name(self.id)

    @property
    def expressions(self) -> tuple[Node, ...]:
        return (self.condition,) if self.when is None else (self.when, self.condition)


def instance_name(id_: str) -> str:
    """`lnd_7` of `LND-7`."""
    return "_".join(part for part in "".join(c if c.isalnum() else " " for c in id_.lower()).split())
