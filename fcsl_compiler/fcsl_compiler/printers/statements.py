# SPDX-License-Identifier: Apache-2.0
"""What the printers of statements share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import assert_never

from ..model import code
from .expressions import Expressions
from .writer import Writer


@dataclass(frozen=True)
class Branch:
    """Of an `if`. `condition`: None for `else`. `at`: where an `elif` stands in the source."""

    condition: code.Expr | None
    body: code.Body
    at: code.At | None = None


def branches(s: code.If, at: code.At | None = None) -> Iterator[Branch]:
    """An `if` that is all of an `else` gives further branches."""
    yield Branch(s.condition, s.then, at)
    match s.otherwise:
        case ():
            pass
        case (code.If() as following,):
            yield from branches(following)
        case (code.At() as mark, code.If() as following):
            yield from branches(following, mark)
        case _:
            yield Branch(None, s.otherwise)


class Statements(ABC):
    """Writes statements and functions. Subclasses know what differs between languages."""

    w: Writer
    e: Expressions
    #: What ends a statement, begins a scope, precedes a call whose result is not needed, and begins a further branch.
    end: str
    scope: str
    discard: str
    else_if: str

    def body(self, statements: code.Body) -> None:
        for s in statements:
            self._statement(s)

    def _statement(self, s: code.Statement) -> None:
        match s:
            case code.At():
                self._at(s)
            case code.Let():
                self._let(s)
            case code.Var():
                self._var(s)
            case code.Table():
                self.table(s)
            case code.Set():
                if s.volatile:
                    self._store(s)
                else:
                    self._line(f"{self.e.text(s.place)} = {self.e.bare(s.value)}")
            case code.Update():
                self._update(s)
            case code.Copy():
                self._copy(s)
            case code.Clear():
                self._clear(s)
            case code.Do():
                self._line(f"{self.discard if s.unused else ''}{self.e.text(s.call)}")
            case code.Unused():
                self._unused(s)
            case code.If():
                self._if(s)
            case code.Select():
                self._select(s)
            case code.Count():
                self._count(s)
            case code.For():
                self._for(s)
            case code.Scope():
                self._nested(self.scope, s.body)
            case code.Return():
                self._line("return" if s.value is None else f"return {self.e.bare(s.value)}")
            case code.Break():
                self._line("break")
            case code.Continue():
                self._line("continue")
            case _:
                assert_never(s)

    def _line(self, text: str) -> None:
        self.w.line(text + self.end)

    def _nested(self, head: str, body: code.Body) -> None:
        self.w.open(head)
        self.body(body)
        self.w.close()

    def _at(self, s: code.At) -> None:
        if s.quoted and s.span is not None:
            self.w.at(s.span)
        else:
            self.w.origin = s.span

    def _if(self, s: code.If) -> None:
        for number, branch in enumerate(branches(s)):
            if branch.at is not None:
                self.w.origin = branch.at.span
            word = self.else_if if number else "if"
            head = "else" if branch.condition is None else f"{word} {self._condition(branch.condition)}"
            (self.w.reopen if number else self.w.open)(head)
            if branch.at is not None:
                self._at(branch.at)
            self.body(branch.body)
        self.w.close()

    def _condition(self, e: code.Expr) -> str:
        return self.e.bare(e)

    @abstractmethod
    def function(self, f: code.Function) -> None: ...

    @abstractmethod
    def table(self, s: code.Table) -> None: ...

    @abstractmethod
    def _let(self, s: code.Let) -> None: ...

    @abstractmethod
    def _var(self, s: code.Var) -> None: ...

    @abstractmethod
    def _store(self, s: code.Set) -> None:
        """Of a volatile place."""

    @abstractmethod
    def _update(self, s: code.Update) -> None: ...

    @abstractmethod
    def _copy(self, s: code.Copy) -> None: ...

    @abstractmethod
    def _clear(self, s: code.Clear) -> None: ...

    @abstractmethod
    def _unused(self, s: code.Unused) -> None: ...

    @abstractmethod
    def _select(self, s: code.Select) -> None: ...

    @abstractmethod
    def _count(self, s: code.Count) -> None: ...

    @abstractmethod
    def _for(self, s: code.For) -> None: ...
