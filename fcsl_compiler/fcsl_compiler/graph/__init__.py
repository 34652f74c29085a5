# SPDX-License-Identifier: Apache-2.0
"""Pictures of a machine: dataflow and state machine, as Mermaid text and as SVG."""

from __future__ import annotations

from ..model.machine import Machine, State
from .fold import fold
from .mermaid import write
from .model import dataflow, state_machine
from .svg import draw

#: File suffixes for `-o`, and the format of each.
FORMATS = {".svg": "SVG", ".mmd": "Mermaid", ".md": "Mermaid in a Markdown code block"}


def render(machine: Machine, state: State | None, suffix: str, folded: bool = False) -> str:
    """The text of a file with this suffix (of FORMATS): dataflow in one state or in all, then the state machine. `folded`:
    each part is one box."""
    pictures = [dataflow(machine, state), state_machine(machine, state)]
    pictures = list(map(fold, pictures)) if folded else pictures
    if suffix == ".svg":
        return draw(pictures)
    text = write(pictures)
    return f"```mermaid\n{text}```\n" if suffix == ".md" else text
