# SPDX-License-Identifier: Apache-2.0
"""Source texts and spans within them."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from pathlib import Path

from .files import MAX_SOURCE_BYTES, SourceError, read_regular

#: Maximum number of characters of a name. Names become identifiers, paths and ROS fields (runtimes accept 255 bytes of
#: each).
MAX_NAME = 100

_NEWLINE = re.compile("\n")
#: Bidirectional control characters. They can make an editor show text in an order other than that of the compiler.
_REORDERING = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def _lines(text: str) -> str:
    """The text with `\n` as the only line ending."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


@dataclass(frozen=True)
class SourceFile:
    """One text file. `name` is shown in messages and generated comments. `path` is where it was read, "" if it has no
    file. `part`: the machine is this part of another one, and `included` is where that names it."""

    name: str
    text: str
    path: str = field(default="", compare=False)
    part: str = ""
    included: Span | None = field(default=None, compare=False)
    _starts: list[int] = field(init=False, repr=False, compare=False, hash=False)

    def __post_init__(self) -> None:
        starts = [0]
        starts.extend(found.end() for found in _NEWLINE.finditer(self.text))
        object.__setattr__(self, "_starts", starts)

    @classmethod
    def read(cls, path: Path, name: str) -> SourceFile:
        """Reads `path` as UTF-8. Raises SourceError if it is missing, not a regular file, too large or not text."""
        try:
            data = read_regular(path, MAX_SOURCE_BYTES)
        except FileNotFoundError:
            raise SourceError("no such file") from None
        except OSError as error:
            raise SourceError(error.strerror or "it cannot be read") from None
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            before = len(_lines(data[: error.start].decode("utf-8-sig", "replace")))
            shown = cls(name, _lines(data.decode("utf-8-sig", "replace")), str(path))
            raise SourceError("it is not UTF-8 text", shown.span(before, before + 1)) from None
        source = cls(name, _lines(text), str(path))
        if "\0" in text:
            raise SourceError(
                "it contains a null byte", source.span(source.text.index("\0"), source.text.index("\0") + 1)
            )
        mark = _REORDERING.search(source.text)
        if mark is not None:
            why = f"U+{ord(mark[0]):04X} displays text in a different order than it is parsed"
            raise SourceError(why, source.span(mark.start(), mark.end()))
        return source

    def line(self, number: int) -> str:
        """Text of line `number` (from 1) without its line ending."""
        if not 1 <= number <= len(self._starts):
            return ""
        start = self._starts[number - 1]
        end = self.text.find("\n", start)
        return self.text[start:] if end < 0 else self.text[start:end]

    def comments_above(self, number: int) -> list[str]:
        """The comment lines directly above a line of Python, without indentation."""
        found: list[str] = []
        while (text := self.line(number - len(found) - 1).strip()).startswith("#"):
            found.insert(0, text)
        return found

    def span(self, start: int, end: int) -> Span:
        """The span of the characters [start, end)."""
        line = bisect_right(self._starts, start)
        end_line = bisect_right(self._starts, max(start, end - 1))
        return Span(
            self,
            line,
            start - self._starts[line - 1] + 1,
            end_line,
            max(start + 1, end) - self._starts[end_line - 1] + 1,
        )

    def offsets(self, span: Span) -> tuple[int, int]:
        """The characters [start, end) of a span of this text."""
        start, end = self._starts[span.line - 1], self._starts[span.end_line - 1]
        return start + span.column - 1, end + span.end_column - 1

    def whole(self) -> Span:
        """An empty span at the start, for messages about the whole file."""
        return Span(self, 1, 1, 1, 1)


@dataclass(frozen=True)
class Span:
    """A range of text. Lines and columns count characters from 1. The end column is exclusive."""

    source: SourceFile
    line: int
    column: int
    end_line: int
    end_column: int

    def __str__(self) -> str:
        return f"{self.source.name}:{self.line}:{self.column}"

    @property
    def text(self) -> str:
        start, end = self.source.offsets(self)
        return self.source.text[start:end]

    def local(self, name: str) -> str:
        """The name of an instance as the file of this span writes it: in that of part `att`, `att.rate` is `rate`."""
        return name.removeprefix(f"{self.source.part}.") if self.source.part else name

    @property
    def key(self) -> tuple[str, int, int]:
        return (self.source.name, self.line, self.column)
