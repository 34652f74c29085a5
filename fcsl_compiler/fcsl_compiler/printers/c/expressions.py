# SPDX-License-Identifier: Apache-2.0
"""C of expressions and types."""

from __future__ import annotations

from collections.abc import Mapping

from ...model import code
from ...model.c_names import c_literal
from ...model.types import HEALTH, REQUEST, Scalar
from ..spelling import Spelling
from .operations import spelling_of

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


class CExpressions:
    """Writes expressions. `helpers` collects the C functions that they call. `extensions`: operations beside those of the
    language."""

    def __init__(self, extensions: Mapping[str, Spelling]):
        self.extensions = extensions
        self.helpers: dict[str, str] = {}

    def bare(self, e: code.Expr) -> str:
        return bare(self.text(e))

    def text(self, e: code.Expr) -> str:
        if isinstance(e, code.Name):
            return e.text
        if isinstance(e, code.Literal):
            return literal(e)
        if isinstance(e, code.Deref):
            return f"*{self.text(e.pointer)}"
        if isinstance(e, code.Member):
            if isinstance(e.base, code.Deref):
                return f"{self.text(e.base.pointer)}->{e.name}"
            return f"{self.text(e.base)}.{e.name}"
        if isinstance(e, code.Element):
            return self._element(e.base, [self.text(e.index)])
        if isinstance(e, code.Part):
            return f"&{self._element(e.base, [self.text(e.start)])}"
        if isinstance(e, code.Address):
            return self._address(e)
        if isinstance(e, code.Operation):
            return self._operation(e)
        if isinstance(e, code.Choice):
            return f"({self.text(e.condition)} ? {self.text(e.then)} : {self.text(e.otherwise)})"
        if isinstance(e, code.And | code.Or):
            return f"({(' && ' if isinstance(e, code.And) else ' || ').join(map(self.text, e.args))})"
        if isinstance(e, code.Not):
            return f"!{self._operand(e.arg)}"
        if isinstance(e, code.Binary):
            return f"{self._operand(e.left)} {e.symbol} {self._operand(e.right)}"
        if isinstance(e, code.Convert):
            return f"({type_name(e.type).rstrip()}){self._operand(e.arg)}"
        if isinstance(e, code.Sum):
            return self._sum(e)
        if isinstance(e, code.CheckedIndex):
            return self._checked(e)
        if isinstance(e, code.Null):
            return "NULL"
        function = e.function if isinstance(e.function, str) else self.text(e.function)
        return f"{function}({', '.join(map(self.bare, e.args))})"

    def _operand(self, e: code.Expr) -> str:
        text = self.text(e)
        return f"({text})" if isinstance(e, code.Binary) else text

    def _element(self, base: code.Place, index: list[str]) -> str:
        if isinstance(base, code.Part):
            return self._element(base.base, [self.text(base.start), *index])
        return f"{self.elements(base)}[{' + '.join(index)}]"

    def elements(self, block: code.Place) -> str:
        """Pointer to the elements of a block."""
        return self.text(block.pointer) if isinstance(block, code.Deref) else self.text(block)

    def _address(self, e: code.Address) -> str:
        if isinstance(e.place, code.Deref):
            return self.text(e.place.pointer)
        return self.text(e.place) if e.block else f"&{self.text(e.place)}"

    def _operation(self, e: code.Operation) -> str:
        spelling = self.extensions.get(e.op.id) or spelling_of(e.op)
        proven = bool(e.op.faults) and not e.places
        text, helper = (spelling.proven, spelling.proven_helper) if proven else (spelling.text, spelling.helper)
        if helper:
            self._help(helper)
        operands = list(map(self.text, e.args))
        if text.startswith("("):
            operands = [f"({o})" if o.startswith("-") else o for o in operands]
        else:
            operands = list(map(bare, operands))
        place = ", ".join(f"{number}u" for number in e.places)
        return text.format(*operands, place=place, fault="" if e.fault is None else self.text(e.fault))

    def _help(self, helper: str) -> None:
        self.helpers[helper.split("(", 1)[0].rsplit(" ", 1)[1]] = helper

    def _sum(self, e: code.Sum) -> str:
        terms = [self.text(term) if stride == 1 else f"{self.text(term)} * {stride}" for term, stride in e.terms]
        if e.constant or not terms:
            terms.append(str(e.constant))
        return " + ".join(terms)

    def _checked(self, e: code.CheckedIndex) -> str:
        self._help(INDEX_HELPER)
        index = self.text(e.index)
        # An index beyond INT64_MAX is always out of range; -1 stands for it.
        wide = f"({index} > (uint64_t)INT64_MAX ? -1 : (int64_t){index})" if e.is_u64 else bare(index)
        return f"fcsl_index({wide}, {e.extent}, {e.place}u, {self.text(e.fault)})"
