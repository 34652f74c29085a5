# SPDX-License-Identifier: Apache-2.0
"""What the printers of expressions share."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping

from ..model import code
from .spelling import Spelling


def bare(text: str) -> str:
    """The expression without the parentheses that enclose all of it."""
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = 0
    for position, char in enumerate(text):
        depth += (char == "(") - (char == ")")
        if depth == 0 and position < len(text) - 1:
            return text
    return text[1:-1]


class Expressions(ABC):
    """Writes expressions. Subclasses know what differs between languages. `spellings`: those of operations by their
    ids. `helpers` collects the functions that expressions call, by name."""

    null: str
    #: Makes a literal the number of a fault's place.
    place_suffix: str

    def __init__(self, spellings: Mapping[str, Spelling], helpers: dict[str, str]):
        self.spellings, self.helpers = spellings, helpers

    def bare(self, e: code.Expr) -> str:
        return self.unwrapped(self.text(e))

    def unwrapped(self, text: str) -> str:
        """The expression as it may stand alone: as an argument, or beside an `=`."""
        return bare(text)

    def text(self, e: code.Expr) -> str:
        match e:
            case code.Name():
                return self._name(e.text)
            case code.Literal():
                return self._literal(e)
            case code.Deref():
                return self._deref(e)
            case code.Member():
                return self._member(e)
            case code.Element():
                return self._element(e.base, [self.text(e.index)])
            case code.Part():
                return self._part(e)
            case code.Address():
                return self._address(e)
            case code.Operation():
                return self._operation(e)
            case code.Choice():
                return self._choice(e)
            case code.And():
                return self._and(e)
            case code.Or():
                return self._or(e)
            case code.Not():
                return self._not(e)
            case code.Binary():
                return f"{self._operand(e.left)} {self._symbol(e)} {self._operand(e.right)}"
            case code.Convert():
                return self._convert(e)
            case code.Sum():
                return self._sum(e)
            case code.CheckedIndex():
                return self._checked(e)
            case code.Null():
                return self.null
            case code.Call():
                function = self._function(e.function) if isinstance(e.function, str) else self.text(e.function)
                return f"{function}({', '.join(map(self.bare, e.args))})"

    def _operand(self, e: code.Expr) -> str:
        text = self.text(e)
        return f"({text})" if isinstance(e, code.Binary) else text

    def _element(self, base: code.Place, index: list[str]) -> str:
        """Element of a block, or of one within it: its index is a sum."""
        if isinstance(base, code.Part):
            return self._element(base.base, [self.text(base.start), *index])
        return f"{self._indexed(base)}[{' + '.join(index)}]"

    def _operation(self, e: code.Operation) -> str:
        spelling = self.spellings[e.op.id]
        proven = bool(e.op.faults) and not e.places
        text, helper = (spelling.proven, spelling.proven_helper) if proven else (spelling.text, spelling.helper)
        for part in filter(None, helper.split("\n\n")):
            self._help(part)
        operands = map(self._within if text.startswith("(") else self.unwrapped, self._operands(e))
        place = ", ".join(f"{number}{self.place_suffix}" for number in e.places)
        return text.format(*operands, place=place, fault="" if e.fault is None else self.text(e.fault))

    def _operands(self, e: code.Operation) -> list[str]:
        return list(map(self.text, e.args))

    def _within(self, operand: str) -> str:
        """An operand beside the symbol of an operator."""
        return operand

    def _help(self, helper: str) -> None:
        name = re.search(r"(\w+)[(\[]", helper)
        assert name is not None
        self.helpers[name[1]] = helper

    def _sum(self, e: code.Sum) -> str:
        terms = [self._index(term) if stride == 1 else f"{self._index(term)} * {stride}" for term, stride in e.terms]
        if e.constant or not terms:
            terms.append(str(e.constant))
        return " + ".join(terms)

    def _index(self, e: code.Expr) -> str:
        return self.text(e)

    def _symbol(self, e: code.Binary) -> str:
        return e.symbol

    def _function(self, name: str) -> str:
        return name

    @abstractmethod
    def _name(self, text: str) -> str: ...

    @abstractmethod
    def _literal(self, e: code.Literal) -> str: ...

    @abstractmethod
    def _deref(self, e: code.Deref) -> str: ...

    @abstractmethod
    def _member(self, e: code.Member) -> str: ...

    @abstractmethod
    def _indexed(self, block: code.Place) -> str:
        """A block as it stands before an index."""

    @abstractmethod
    def _part(self, e: code.Part) -> str: ...

    @abstractmethod
    def _address(self, e: code.Address) -> str: ...

    @abstractmethod
    def _choice(self, e: code.Choice) -> str: ...

    @abstractmethod
    def _and(self, e: code.And) -> str: ...

    @abstractmethod
    def _or(self, e: code.Or) -> str: ...

    @abstractmethod
    def _not(self, e: code.Not) -> str: ...

    @abstractmethod
    def _convert(self, e: code.Convert) -> str: ...

    @abstractmethod
    def _checked(self, e: code.CheckedIndex) -> str: ...
