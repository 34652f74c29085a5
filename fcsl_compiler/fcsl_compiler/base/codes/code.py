# SPDX-License-Identifier: Apache-2.0
"""One row of the table of diagnostic codes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """The kind of source that an example is part of."""

    BODY = "statements of the example algorithm's `execute`"
    FILE = "an algorithm file; if it has no class, one without ports is added"
    SIMULATION = "members of a simulation"
    JSON = "members of the example machine, in place of those of the same name"
    STRICT = "members of the example machine, checked with --strict"
    TEXT = "the whole text of a machine JSON"
    BOARD = "members of the example board, in place of those of the same name"
    CHANNELS = "members of the machine of the example board"
    COMMAND = "a command"


@dataclass(frozen=True)
class Code:
    title: str
    explanation: str
    kind: Kind
    wrong: str
    right: str
