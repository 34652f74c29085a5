# SPDX-License-Identifier: Apache-2.0
"""Collects lines of C with indentation and the source span of each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..base.source import Span
from ..model.c_names import c_comment

Lines = tuple[list[str], list[Span | None]]


class CWriter:
    """Collects lines. `origins[i]` is the span that line i was generated from, or None."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.origins: list[Span | None] = []
        self.origin: Span | None = None
        self._indent = 0
        self._said: tuple[str, int] | None = None

    @property
    def depth(self) -> int:
        """Number of open braces."""
        return self._indent

    def line(self, text: str = "") -> None:
        self.lines.append("    " * self._indent + text if text else "")
        self.origins.append(self.origin)

    def block(self, text: str) -> None:
        """Appends several lines, keeping their relative indentation."""
        for part in text.rstrip("\n").split("\n"):
            self.line(part)

    @contextmanager
    def braces(self, head: str, tail: str = "}") -> Iterator[None]:
        self.line(f"{head} {{" if head else "{")
        self._indent += 1
        yield
        self._indent -= 1
        self.line(tail)

    @contextmanager
    def indented(self) -> Iterator[None]:
        self._indent += 1
        yield
        self._indent -= 1

    def open(self, head: str) -> None:
        self.line(f"{head} {{")
        self._indent += 1

    def open_body(self) -> None:
        """Writes the opening brace of a function or block on a separate line."""
        self.line("{")
        self._indent += 1

    def reopen(self, head: str) -> None:
        self._indent -= 1
        self.line(f"}} {head} {{")
        self._indent += 1

    def close(self, tail: str = "}") -> None:
        self._indent -= 1
        self.line(tail)

    def at(self, span: Span) -> None:
        """Sets the span of the following lines. If it is a new source line, writes that line and the comments above it
        as a C comment."""
        self.origin = span
        key = (span.source.name, span.line)
        if key != self._said:
            self._said = key
            for text in span.source.comments_above(span.line):
                self.line(f"/* {c_comment(text)} */")
            text = span.source.line(span.line).strip()
            self.line(f"/* {c_comment(span.source.name)}:{span.line}: {c_comment(text)} */")

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
