# SPDX-License-Identifier: Apache-2.0
"""Diagnostics as values: what is wrong, where, why, and what to write instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from .source import Span

#: Of errors and of warnings no more than this are kept; nobody reads further.
MAX_DIAGNOSTICS = 200


class Severity(Enum):
    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Note:
    """A second place that matters."""

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

    def render(self) -> str:
        """The text a user reads: message, location, source line with caret, notes, reason, fix."""
        lines = [f"{self.span}: {self.severity.value}[{self.code}]: {self.message}"]
        lines += _excerpt(self.span, "")
        for note in self.notes:
            lines.append(f"{note.span}: note: {note.text}")
            lines += _excerpt(note.span, "")
        if self.why:
            lines.append(f"  = why: {self.why}")
        if self.help:
            lines.append(f"  = help: {self.help}")
        return "\n".join(lines)


def _excerpt(span: Span, label: str) -> list[str]:
    text = span.source.line(span.line)
    if not text.strip():
        return []
    column = min(span.column, len(text) + 1)
    end = span.end_column if span.end_line == span.line else len(text) + 1
    # A window keeps a minified file from filling the terminal.
    start = max(0, column - 81) if len(text) > 160 else 0
    shown = text[start : start + 160]
    pad = "".join("\t" if c == "\t" else " " for c in shown[: column - 1 - start])
    width = max(1, min(end - column, len(shown) - len(pad)))
    gutter = f"{span.line:>5} | "
    return [gutter + shown, " " * 5 + " | " + pad + "^" * width + (f" {label}" if label else "")]


class DiagnosticError(Exception):
    """Compilation failed; str() is the rendered text of every diagnostic."""

    def __init__(self, diagnostics: Sequence[Diagnostic]):
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(d.render() for d in self.diagnostics))


class DiagnosticSink:
    """Collects diagnostics; the same statement about the same place is kept once."""

    def __init__(self) -> None:
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
    ) -> None:
        self._add(Severity.ERROR, code, message, span, why, help, notes)

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
    ) -> None:
        key = (code, message, span.key)
        if key in self._seen or self._count[severity] >= MAX_DIAGNOSTICS:
            return
        self._seen.add(key)
        self._count[severity] += 1
        self._diagnostics.append(
            Diagnostic(severity, code, message, span, why, help_text, tuple(Note(s, t) for s, t in notes))
        )

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """In the order of their discovery."""
        return list(self._diagnostics)

    @property
    def errors(self) -> int:
        """Errors reported so far."""
        return self._count[Severity.ERROR]

    @property
    def failed(self) -> bool:
        return self.errors > 0

    def raise_if_failed(self) -> None:
        """Raises DiagnosticError when any error was reported."""
        if self.failed:
            raise DiagnosticError([d for d in self._diagnostics if d.severity is Severity.ERROR])


def nearest(word: str, choices: Sequence[str]) -> str:
    """' Did you mean …?' for the closest choice, or the empty string."""
    import difflib

    match = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return f"did you mean `{match[0]}`?" if match else ""
