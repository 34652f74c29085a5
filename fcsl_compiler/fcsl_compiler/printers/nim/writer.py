# SPDX-License-Identifier: Apache-2.0
"""Collects lines of Nim."""

from __future__ import annotations

from ..writer import Writer


class NimWriter(Writer):
    step = "  "

    def comment(self, text: str) -> None:
        self.line(f"# {text}")

    def open(self, head: str) -> None:
        self.line(f"{head}:")
        self._indent += 1

    def reopen(self, head: str) -> None:
        self.close()
        self.open(head)

    def close(self) -> None:
        self._indent -= 1
