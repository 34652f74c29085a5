# SPDX-License-Identifier: Apache-2.0
"""Collects lines of Nim."""

from __future__ import annotations

from ..writer import Writer


class NimWriter(Writer):
    step = "  "

    def comment(self, text: str) -> None:
        self.line(f"# {text}")
