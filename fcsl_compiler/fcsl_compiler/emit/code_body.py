# SPDX-License-Identifier: Apache-2.0
"""Collects the statements of nested bodies."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..model.code import Body, Statement


class CodeBody:
    """The innermost open body receives what is added."""

    def __init__(self) -> None:
        self._open: list[list[Statement]] = [[]]

    @property
    def depth(self) -> int:
        """Number of bodies around the innermost one."""
        return len(self._open) - 1

    def add(self, *statements: Statement) -> None:
        self._open[-1] += statements

    @contextmanager
    def nested(self) -> Iterator[list[Statement]]:
        """Collects the statements of a nested body in the list."""
        inner: list[Statement] = []
        self._open.append(inner)
        yield inner
        self._open.pop()

    def taken(self) -> Body:
        """The statements of the outermost body, which is empty afterwards."""
        (whole,) = self._open
        self._open = [[]]
        return tuple(whole)
