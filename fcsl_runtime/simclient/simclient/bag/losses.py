# SPDX-License-Identifier: Apache-2.0
"""The parts of a file that cannot be read, and how they are told."""

from __future__ import annotations

from dataclasses import dataclass, field

from .seconds import seconds

#: Most parts that are listed.
_MAX_LISTED = 3


@dataclass(frozen=True)
class Loss:
    """file[begin:end], why it cannot be read, and the times between which its messages were recorded, if known."""

    begin: int
    end: int
    why: str
    span_ns: tuple[int, int] | None = None

    def __str__(self) -> str:
        span = f"{seconds(self.span_ns[0])} s to {seconds(self.span_ns[1])} s, " if self.span_ns else ""
        return f"{span}bytes {self.begin} to {self.end} ({self.why})"


@dataclass
class Losses:
    """Those of one file. `undefined`: messages whose topic's definition is lost. `misdated`: messages that were read too
    late to be in the order of time, because their chunk gives a later first time."""

    parts: list[Loss] = field(default_factory=list)
    undefined: int = 0
    misdated: int = 0

    def __str__(self) -> str:
        """What is missing; empty if nothing is."""
        texts = [f"lacks {part}" for part in sorted(self.parts, key=lambda part: part.begin)[:_MAX_LISTED]]
        if len(self.parts) > _MAX_LISTED:
            lost = sum(part.end - part.begin for part in self.parts)
            texts.append(f"and {len(self.parts) - _MAX_LISTED} more parts, {lost} bytes in all")
        if self.undefined:
            texts.append(f"has {self.undefined} messages of topics whose definitions are lost")
        if self.misdated:
            texts.append(f"has {self.misdated} messages of before the first time of their chunk")
        return "; ".join(texts)
