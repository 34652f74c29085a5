# SPDX-License-Identifier: Apache-2.0
"""Collects lines of generated text with indentation and the source span of each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from ..base.source import Span

Lines = tuple[list[str], list[Span | None]]


class Writer(ABC):
    """Collects lines. `origins[i]` is the span that line i was generated from, or None."""

    step = "    "

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.origins: list[Span | None] = []
        self.origin: Span | None = None
        self._indent = 0
        self._last_line: tuple[str, int] | None = None

    def line(self, text: str = "") -> None:
        self.lines.append(self.step * self._indent + text if text else "")
        self.origins.append(self.origin)

    def block(self, text: str) -> None:
        """Appends several lines, keeping their relative indentation."""
        for part in text.rstrip("\n").split("\n"):
            self.line(part)

    @abstractmethod
    def comment(self, text: str) -> None: ...

    @abstractmethod
    def open(self, head: str) -> None:
        """Begins a block of statements."""

    @abstractmethod
    def reopen(self, head: str) -> None:
        """Ends a block and begins the next branch of the same statement."""

    @abstractmethod
    def close(self) -> None: ...

    @contextmanager
    def indented(self) -> Iterator[None]:
        self._indent += 1
        yield
        self._indent -= 1

    def at(self, span: Span) -> None:
        """Sets the span of the following lines. If it is a new source line, writes that line and the comments above it
        as comments."""
        self.origin = span
        key = (span.source.name, span.line)
        if key != self._last_line:
            self._last_line = key
            for text in span.source.comments_above(span.line):
                self.comment(text)
            self.comment(f"{span.source.name}:{span.line}: {span.source.line(span.line).strip()}")

    def mark(self) -> int:
        return len(self.lines)

    def cut(self, mark: int) -> Lines:
        """Removes and returns all lines since `mark`."""
        lines, origins = self.lines[mark:], self.origins[mark:]
        del self.lines[mark:], self.origins[mark:]
        return lines, origins

    def paste(self, cut: Lines) -> None:
        self.lines += cut[0]
        self.origins += cut[1]

    def text(self) -> str:
        return "\n".join(self.lines) + "\n"
