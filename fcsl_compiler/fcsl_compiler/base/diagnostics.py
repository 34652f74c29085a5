# SPDX-License-Identifier: Apache-2.0
"""Diagnostics as values: message, place, reason and correction."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from .source import Span

#: Maximum number of errors, and of warnings, that are kept.
MAX_DIAGNOSTICS = 200

#: Longer texts (they can quote names of the input) are truncated to this many characters.
_MAX_TEXT = 400
_MAX_OUTPUT_LINES = 200

#: Codes about an undefined name. Every use of the name is the same mistake, so further uses become notes of the first.
_OF_NAMES = frozenset({"E206", "E216", "E225", "E406", "E408"})
_MAX_USES = 8


class Severity(Enum):
    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Note:
    """An additional place that a diagnostic refers to."""

    span: Span
    text: str


@dataclass(frozen=True)
class Diagnostic:
    severity: Severity
    code: str
    message: str
    span: Span
    why: str = ""
    help: str = ""
    notes: tuple[Note, ...] = ()
    #: What another program (a C compiler) printed; shown as it is, line by line.
    output: str = ""

    def render(self) -> str:
        """The text shown to users: message, location, source line with caret, output of another program, notes, reason,
        correction."""
        lines = [f"{self.span}: {self.severity.value}[{self.code}]: {self.message}"]
        lines += excerpt(self.span)
        lines += _output(self.output)
        for note in self.notes:
            lines.append(f"{note.span}: note: {note.text}")
            lines += excerpt(note.span)
        if self.why:
            lines.append(f"  = why: {self.why}")
        if self.help:
            lines.append(f"  = help: {self.help}")
        return "\n".join(lines)


def excerpt(span: Span) -> list[str]:
    """The source line of a span, with carets below it. Empty if that line is empty."""
    text = span.source.line(span.line)
    if not text.strip():
        return []
    column = min(span.column, len(text) + 1)
    end = span.end_column if span.end_line == span.line else len(text) + 1
    # Show a window only, because a line of a minified file may be very long.
    start = max(0, column - 81) if len(text) > 160 else 0
    shown = "".join(c if c == "\t" or c.isprintable() else "\ufffd" for c in text[start : start + 160])
    before, marked = shown[: column - 1 - start], shown[column - 1 - start : max(column, end - 1) - start]
    pad = "".join("\t" if c == "\t" else " " * _cells(c) for c in before)
    width = max(1, sum(map(_cells, marked)))
    return [f"{span.line:>5} | {shown}", " " * 5 + " | " + pad + "^" * width]


def _cells(char: str) -> int:
    """Columns of a terminal that a character occupies."""
    if unicodedata.combining(char):
        return 0
    return 2 if unicodedata.east_asian_width(char) in ("W", "F") else 1


def _printable(text: str) -> str:
    """The text on one line, with control characters replaced. Names in the input may contain any character."""
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return shown if len(shown) <= _MAX_TEXT else shown[: _MAX_TEXT - 1] + "…"


def _output(text: str) -> list[str]:
    """The lines of another program's output, without control characters. Of a very long one the first and their number."""
    lines = ["".join(c if c == "\t" or c.isprintable() else "\ufffd" for c in line) for line in text.splitlines()]
    if len(lines) <= _MAX_OUTPUT_LINES:
        return lines
    return [*lines[:_MAX_OUTPUT_LINES], f"({len(lines) - _MAX_OUTPUT_LINES} more lines)"]


def _inclusions(span: Span) -> list[tuple[Span, str]]:
    """Where the machines name the file of a span as a part, from inside out."""
    found: list[tuple[Span, str]] = []
    while (at := span.source.included) is not None:
        found.append((at, f"`{span.source.part}` is a part here"))
        span = at
    return found


class DiagnosticError(Exception):
    """Compilation failed. str() is the rendered text of all diagnostics."""

    def __init__(self, diagnostics: Sequence[Diagnostic]):
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(d.render() for d in self.diagnostics))


class DiagnosticSink:
    """Collects diagnostics. Duplicates are dropped: the same text at the same place, and repeated uses of an undefined
    name in a file."""

    def __init__(self) -> None:
        self._named: dict[tuple[str, str, str], int] = {}
        self._diagnostics: list[Diagnostic] = []
        self._seen: set[tuple[str, str, tuple[str, int, int]]] = set()
        self._count = {Severity.ERROR: 0, Severity.WARNING: 0}

    def error(
        self,
        code: str,
        message: str,
        span: Span,
        *,
        why: str = "",
        help: str = "",
        notes: Sequence[tuple[Span, str]] = (),
        output: str = "",
    ) -> None:
        self._add(Severity.ERROR, code, message, span, why, help, notes, output)

    def warning(
        self,
        code: str,
        message: str,
        span: Span,
        *,
        why: str = "",
        help: str = "",
        notes: Sequence[tuple[Span, str]] = (),
    ) -> None:
        self._add(Severity.WARNING, code, message, span, why, help, notes)

    def _add(
        self,
        severity: Severity,
        code: str,
        message: str,
        span: Span,
        why: str,
        help_text: str,
        notes: Sequence[tuple[Span, str]],
        output: str = "",
    ) -> None:
        message = _printable(message)
        key = (code, message, span.key)
        if key in self._seen:
            return
        self._seen.add(key)
        if code in _OF_NAMES:
            first = self._named.setdefault((code, message, span.source.name), len(self._diagnostics))
            if first < len(self._diagnostics):
                known = self._diagnostics[first]
                if len(known.notes) < _MAX_USES:
                    self._diagnostics[first] = replace(known, notes=(*known.notes, Note(span, "and here")))
                return
        if self._count[severity] >= MAX_DIAGNOSTICS:
            return
        self._count[severity] += 1
        places = tuple(Note(s, _printable(t)) for s, t in [*notes, *_inclusions(span)])
        self._diagnostics.append(
            Diagnostic(severity, code, message, span, _printable(why), _printable(help_text), places, output)
        )

    def extend(self, diagnostics: Sequence[Diagnostic], note: Note | None) -> None:
        """Adds diagnostics of another sink, each with one more note."""
        for d in diagnostics:
            notes = [(n.span, n.text) for n in (*d.notes, *([note] if note else []))]
            self._add(d.severity, d.code, d.message, d.span, d.why, d.help, notes, d.output)

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """All diagnostics in the order of their discovery."""
        return list(self._diagnostics)

    @property
    def errors(self) -> int:
        """Number of errors reported so far."""
        return self._count[Severity.ERROR]

    @property
    def full(self) -> bool:
        """True if no further error will be kept."""
        return self._count[Severity.ERROR] >= MAX_DIAGNOSTICS

    @property
    def failed(self) -> bool:
        return self.errors > 0

    def raise_if_failed(self) -> None:
        """Raises DiagnosticError if an error was reported."""
        if self.failed:
            raise DiagnosticError([d for d in self._diagnostics if d.severity is Severity.ERROR])


def longer_paths(path: str, choices: Iterable[str]) -> list[str]:
    """The choices that have more names at a dot of `path`. `att.outputs.u` is a port of part `att`; the field is
    `att.rate.outputs.u`."""
    ends = [(path[: n + 1], path[n:]) for n, char in enumerate(path) if char == "."]
    return [c for c in choices if any(c.startswith(a) and c.endswith(b) and len(c) > len(path) for a, b in ends)]


def misspelt(word: str, choices: Sequence[str]) -> str:
    """The choice that `word` probably stands for, or ""."""
    import difflib

    same = next((c for c in choices if c.lower() == word.lower()), "") or next(iter(longer_paths(word, choices)), "")
    return same or next(
        iter(difflib.get_close_matches(word[:100], choices, n=1, cutoff=0.65 if len(word) != 3 else 0.5)), ""
    )


def nearest(word: str, choices: Sequence[str]) -> str:
    """`Did you mean …?` for the closest choice, or ""."""
    match = misspelt(word, choices)
    return f"did you mean `{match}`?" if match else ""
