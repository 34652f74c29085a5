# SPDX-License-Identifier: Apache-2.0
"""Values of expressions that consist of literals only, in the type that the context determines.

Integer arithmetic is exact; only the final result must fit. Float arithmetic rounds every literal and every result, as
the target does.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..base.source import SourceFile
from ..model.literals import LiteralError, decimal_f32, fit, round_f32
from ..model.types import F32, F64, I64, NUMBERS, Scalar
from ..parse.python_source import text_of
from .scope import BUILTIN_CONSTANTS, Constant, UntypedConstant

#: Limit for integer literals. It bounds the time of folding; no type holds larger values.
_MAX_BITS = 4096

_OPERATORS: dict[type[ast.operator], tuple[str, Callable[[int | float, int | float], int | float]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.FloorDiv: ("//", operator.floordiv),
    ast.Mod: ("%", operator.mod),
}
_ON_BITS: dict[type[ast.operator], tuple[str, Callable[[int, int], int]]] = {
    ast.LShift: ("<<", operator.lshift),
    ast.RShift: (">>", operator.rshift),
    ast.BitAnd: ("&", operator.and_),
    ast.BitOr: ("|", operator.or_),
    ast.BitXor: ("^", operator.xor),
}


@dataclass(frozen=True)
class LiteralNames:
    """The names in one file that denote literals."""

    source: SourceFile
    constants: Mapping[str, Constant]
    sizes: Mapping[str, int]
    is_bound: Callable[[str], bool] = lambda name: False  # whether the function has a local of this name

    def is_literal(self, node: ast.expr) -> bool:
        """Whether a name or a constant is a literal number."""
        if isinstance(node, ast.Constant):
            return type(node.value) in (int, float)
        if not isinstance(node, ast.Name):
            return False
        if node.id in self.constants:
            return isinstance(self.constants[node.id], UntypedConstant)
        return node.id in self.sizes or (node.id in BUILTIN_CONSTANTS and not self.is_bound(node.id))

    def holds_float(self, node: ast.expr) -> bool:
        """Whether such a literal is a float."""
        if isinstance(node, ast.Constant):
            return type(node.value) is float
        constant = self.constants.get(node.id) if isinstance(node, ast.Name) else None
        if isinstance(constant, UntypedConstant):
            return constant.holds_float
        return isinstance(node, ast.Name) and node.id not in self.sizes

    def value(self, node: ast.expr, target: Scalar) -> int | float:
        """The value of an expression of literals in type `target`. Raises LiteralError."""
        value = self._value(node, target)
        return fit(value, target) if isinstance(value, int) else value

    def _value(self, node: ast.expr, target: Scalar) -> int | float:
        """Like `value`, but an integer result need not fit `target`."""
        if isinstance(node, ast.Constant):
            return self._constant(node, target)
        if isinstance(node, ast.Name):
            return self._named(node, target)
        if isinstance(node, ast.UnaryOp):
            operand = self._value(node.operand, target)
            if isinstance(node.op, ast.USub) and operand == 0 and _is_whole(node.operand):
                return operand  # the integer -0 is 0
            if isinstance(node.op, ast.USub):
                return -operand
            if isinstance(operand, int):
                return ~operand
            raise LiteralError(f"`~` of {target}", "bits belong to integers")
        if isinstance(node, ast.BinOp):
            return self._binary(node, target)
        assert isinstance(node, ast.Call)  # only sqrt
        operand = self._value(node.args[0], target)
        if target.is_integer:
            raise LiteralError(f"`sqrt` of {target}", "it is for floats only")
        if operand < 0.0:
            raise LiteralError("the square root of a negative number", "write `nan`")
        return _round(math.sqrt(operand), target)

    def _constant(self, node: ast.Constant, target: Scalar) -> int | float:
        value = node.value
        assert isinstance(value, int | float)
        if isinstance(value, int):
            _check_size(value)
            return value if target.is_integer else fit(value, target)
        if math.isinf(value):
            raise LiteralError("the literal is beyond the range of f64", "an infinity is written `inf`")
        number = fit(value, target)
        return decimal_f32(text_of(self.source, node)) if target is F32 else number

    def _named(self, node: ast.Name, target: Scalar) -> int | float:
        constant = self.constants.get(node.id)
        if isinstance(constant, UntypedConstant):
            value = constant.values[target]
            if isinstance(value, LiteralError):
                raise value
            return value
        return fit(BUILTIN_CONSTANTS[node.id], target) if node.id not in self.sizes else self._size(node.id, target)

    def _size(self, name: str, target: Scalar) -> int | float:
        size = self.sizes[name]
        return size if target.is_integer else fit(size, target)

    def _binary(self, node: ast.BinOp, target: Scalar) -> int | float:
        left = self._value(node.left, target)
        if isinstance(node.op, ast.Pow):
            return self._power(left, int(self._value(node.right, I64)), target)
        if isinstance(node.op, ast.LShift | ast.RShift):
            symbol, shift = _ON_BITS[type(node.op)]
            count = self._value(node.right, I64)
            if not isinstance(left, int) or not isinstance(count, int):
                raise LiteralError(f"no `{symbol}` of {target}", "bits belong to integers")
            if not 0 <= count < _MAX_BITS:
                raise LiteralError(f"a shift by {count}", "no type of the language has as many bits")
            return _check_size(shift(left, count))
        right = self._value(node.right, target)
        if type(node.op) in _ON_BITS:
            symbol, bits = _ON_BITS[type(node.op)]
            if isinstance(left, int) and isinstance(right, int):
                return bits(left, right)
            raise LiteralError(f"no `{symbol}` between {target} and {target}", "bits belong to integers")
        symbol, function = _OPERATORS[type(node.op)]
        if symbol == "/" and target.is_integer:
            raise LiteralError("`/` between two integers", "write `//` for the floor, or a float literal")
        if right == 0 and symbol in "//%":
            raise LiteralError("division by zero", "the divisor is a constant zero")
        value = function(left, right)
        return _check_size(value) if isinstance(value, int) else _round(value, target)

    def _power(self, base: int | float, exponent: int, target: Scalar) -> int | float:
        result: int | float = 1 if isinstance(base, int) else 1.0
        for _ in range(exponent):
            result = result * base
            result = _check_size(result) if isinstance(result, int) else _round(result, target)
        return result


def _is_whole(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is int


def _check_size(value: int) -> int:
    if value.bit_length() > _MAX_BITS:
        raise LiteralError("the integer is too large", "no type of the language can represent it")
    return value


def _round(value: float, target: Scalar) -> float:
    return round_f32(value) if target is F32 else value


def untyped_constant(names: LiteralNames, node: ast.expr, holds_float: bool) -> UntypedConstant:
    """The values of a constant of literals in every numeric type."""
    values: dict[Scalar, int | float | LiteralError] = {}
    for target in NUMBERS:
        try:
            # The integer need not fit yet: a constant computed from it may fit.
            values[target] = names._value(node, target)
        except LiteralError as error:
            values[target] = error
    return UntypedConstant(values, holds_float)


def default_type(holds_float: bool) -> Scalar:
    """The type of literals that have no other type in their group."""
    return F64 if holds_float else I64
