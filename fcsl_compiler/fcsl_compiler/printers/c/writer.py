# SPDX-License-Identifier: Apache-2.0
"""Collects lines of C."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...model.c_names import c_comment
from ..writer import Writer


class CWriter(Writer):
    def comment(self, text: str) -> None:
        self.line(f"/* {c_comment(text)} */")

    @contextmanager
    def braces(self, head: str, tail: str = "}") -> Iterator[None]:
        self.open(head)
        yield
        self.close(tail)

    def open(self, head: str) -> None:
        self.line(f"{head} {{" if head else "{")
        self._indent += 1

    def reopen(self, head: str) -> None:
        self._indent -= 1
        self.line(f"}} {head} {{")
        self._indent += 1

    def close(self, tail: str = "}") -> None:
        self._indent -= 1
        self.line(tail)
