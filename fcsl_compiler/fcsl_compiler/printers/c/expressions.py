# SPDX-License-Identifier: Apache-2.0
"""C of expressions and types."""

from __future__ import annotations

from collections.abc import Mapping

from ...model import code
from ...model.c_names import c_literal
from ...model.types import HEALTH, REQUEST, Scalar
from ..expressions import Expressions
from ..spelling import Spelling
from .operations import SPELLINGS

INDEX_HELPER = """static inline int64_t fcsl_index(int64_t index, int64_t size, uint32_t place, uint32_t *fault)
{
    if (index < 0 || index >= size) {
        fcsl_fault(place, fault);
        return 0;
    }
    return index;
}
"""


def type_name(type_: code.Type) -> str:
    """C type of a value or of one element of a block. A pointer to a block is one to its first element."""
    if isinstance(type_, Scalar):
        return type_.c
    if isinstance(type_, code.Named):
        return type_.name
    if isinstance(type_, code.Block):
        return type_name(type_.element)
    return f"{'' if type_.writable else 'const '}{type_name(type_.target)} *"


def declarator(type_: code.Type, name: str) -> str:
    """Declaration of a variable or member without its value."""
    head = type_name(type_)
    extent = f"[{type_.count}]" if isinstance(type_, code.Block) else ""
    return f"{head}{'' if head.endswith('*') else ' '}{name}{extent}"


def constant_declarator(type_: code.Type, name: str) -> str:
    if isinstance(type_, code.Pointer):
        return f"{type_name(type_)}const {name}"
    return f"const {declarator(type_, name)}"


def zero(type_: code.Type) -> str:
    """Initialiser that sets all of a variable to zero."""
    if not isinstance(type_, Scalar):
        return "{0}"
    return "0.0" if type_.name == "f64" else "0.0f" if type_.name == "f32" else "false" if type_.name == "bool" else "0"


def literal(e: code.Literal) -> str:
    return str(int(e.value)) if e.type in (REQUEST, HEALTH) else c_literal(e.value, e.type)


class CExpressions(Expressions):
    """Writes expressions. `extensions`: operations beside those of the language."""

    null = "NULL"
    place_suffix = "u"

    def __init__(self, extensions: Mapping[str, Spelling]):
        super().__init__({**SPELLINGS, **extensions}, {})

    def elements(self, block: code.Place) -> str:
        """Pointer to the elements of a block."""
        return self.text(block.pointer) if isinstance(block, code.Deref) else self.text(block)

    def _name(self, text: str) -> str:
        return text

    def _literal(self, e: code.Literal) -> str:
        return literal(e)

    def _deref(self, e: code.Deref) -> str:
        return f"*{self.text(e.pointer)}"

    def _member(self, e: code.Member) -> str:
        if isinstance(e.base, code.Deref):
            return f"{self.text(e.base.pointer)}->{e.name}"
        return f"{self.text(e.base)}.{e.name}"

    def _indexed(self, block: code.Place) -> str:
        return self.elements(block)

    def _part(self, e: code.Part) -> str:
        return f"&{self._element(e.base, [self.text(e.start)])}"

    def _address(self, e: code.Address) -> str:
        if isinstance(e.place, code.Deref):
            return self.text(e.place.pointer)
        return self.text(e.place) if e.block else f"&{self.text(e.place)}"

    def _choice(self, e: code.Choice) -> str:
        return f"({self.text(e.condition)} ? {self.text(e.then)} : {self.text(e.otherwise)})"

    def _and(self, e: code.And) -> str:
        return f"({' && '.join(map(self.text, e.args))})"

    def _or(self, e: code.Or) -> str:
        return f"({' || '.join(map(self.text, e.args))})"

    def _not(self, e: code.Not) -> str:
        return f"!{self._operand(e.arg)}"

    def _convert(self, e: code.Convert) -> str:
        return f"({type_name(e.type).rstrip()}){self._operand(e.arg)}"

    def _within(self, operand: str) -> str:
        return f"({operand})" if operand.startswith("-") else operand

    def _checked(self, e: code.CheckedIndex) -> str:
        self._help(INDEX_HELPER)
        index = self.text(e.index)
        # An index beyond INT64_MAX is always out of range; -1 stands for it.
        wide = f"({index} > (uint64_t)INT64_MAX ? -1 : (int64_t){index})" if e.is_u64 else self.unwrapped(index)
        return f"fcsl_index({wide}, {e.extent}, {e.place}u, {self.text(e.fault)})"
