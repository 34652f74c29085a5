# SPDX-License-Identifier: Apache-2.0
"""Text to a checked expression. The syntax is Python's, read by `ast` and never executed; the server of variables reads the same
language in C (fcsl_expression.h), and a test compares both.

    abs(nav.outputs.force) < pilot.parameters.limit and machine.state in ('RUN', 'SAFE')
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction

from ..base.diagnostics import nearest
from . import units
from .tree import ExpressionError, Kind, Node, Quantity
from .units import Unit

#: What a path is. Raises ExpressionError.
Find = Callable[[str], Quantity]

#: As fcsl_expression.h has them.
BYTES_MAX = 1023
VALUES_MAX = 256
DEPTH_MAX = 32
ARGUMENTS_MAX = 8
VECTOR_MAX = 16
STEPS_MAX = 1024
#: Of the tree: each of C's levels has a comparison, a sum, a product and a power at most.
_LEVELS_MAX = 4 * DEPTH_MAX

_ARITHMETIC: dict[type[ast.operator], str] = {
    **{ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%", ast.Pow: "**"},
}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    **{ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="},
}
_MEMBERSHIP: dict[type[ast.cmpop], str] = {ast.In: "in", ast.NotIn: "not in"}
_LITERAL = re.compile(r"0|[1-9]\d*|(\d+\.\d*|\.\d+|\d+(?=[eE]))([eE][+-]?\d+)?|'[^'\\]*'|\"[^\"\\]*\"|True|False")
_PATH = re.compile(r"[\w.]+(\[[\d, ]+\]|\.\w+)*")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
WORDS = {"true": True, "false": False}
#: Of one value each, or of two and more.
FUNCTIONS = ("abs", "min", "max", "sqrt", "degrees", "norm", "isnan", "isfinite")
#: Of all ticks of a flight; `min` and `max` of one value are, too.
CONDITIONS = ("any", "all", "time", "duration")
SERIES_FUNCTIONS = ("first", "last", "min", "max", "mean", "std", "rms", *CONDITIONS)
#: Of the ticks so far, in requirements: what each takes, `p` a condition, `x` a value, `s` a time in seconds.
PAST_FUNCTIONS = {
    **{"previous": "x", "rose": "p", "fell": "p", "once": "p", "since": "pp", "held": "ps", "within": "pps"},
    **{"max_over": "xs", "min_over": "xs"},
}
_PAST_EXAMPLES = {"p": "a condition", "x": "a value", "s": "a time in s, such as 0.5"}

_NUMBERS = (Kind.BOOL, Kind.INTEGER, Kind.FLOAT)
_SECOND = units.read("s")
_DEGREE = units.read("deg")


def parse(
    text: str,
    find: Find,
    series: bool = False,
    metrics: Mapping[str, Quantity] | None = None,
    condition: bool = False,
    pure_numbers: bool = False,
    past: bool = False,
) -> Node:
    """find: what a path is. series: with the functions of all ticks. metrics: names of other expressions that it may read.
    condition: it must be true or false. past: with the functions of the ticks so far. pure_numbers: a factor of literals alone converts no unit, so `2 * x` has that of x.

    Raises ExpressionError.
    """
    text = text.strip()
    _check_text(text)
    try:
        tree = ast.parse(text, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise ExpressionError(f"`{text}` is no expression{_unread(text, error)}") from None
    functions = (*FUNCTIONS, *(SERIES_FUNCTIONS if series else ()), *(PAST_FUNCTIONS if past else ()))
    root = _Checker(text, find, series, metrics or {}, pure_numbers, tuple(dict.fromkeys(functions))).root(
        tree, condition
    )
    if not series and _steps(root) > STEPS_MAX:
        raise ExpressionError(f"`{text[:60]}…` is too long: write parts of it by themselves")
    return root


def _unread(text: str, error: Exception) -> str:
    """Where Python gave up."""
    if not isinstance(error, SyntaxError) or error.lineno != 1:
        return ""
    rest = text[error.offset - 1 :] if error.offset else ""
    if error.msg.endswith("was never closed"):
        return f": `{rest[:1]}` is not closed"
    return f" from `{rest}` on" if rest else ": it breaks off"


def _check_text(text: str) -> None:
    """What Python would read, and C does not."""
    if len(text.encode(errors="replace")) > BYTES_MAX:
        raise ExpressionError(f"`{text[:60]}…` is too long: it has more than {BYTES_MAX} bytes")
    if "#" in _QUOTED.sub("", text):
        raise ExpressionError(f"`{text}`: an expression has no comment")


def _parentheses(text: str) -> int:
    """How many of them are open at most."""
    depth = deepest = 0
    for c in _QUOTED.sub("", text):
        depth += (c in "([") - (c in ")]")
        deepest = max(deepest, depth)
    return deepest


def _steps(node: Node) -> int:
    """How many steps C makes of it, or some more."""
    parts = sum(map(_steps, node.parts))
    if node.operator == "norm":
        return (node.parts[0].quantity.shape[0]) * (parts + 2) + 1
    return parts + max(1, len(node.parts)) + (node.operator in ("in", "not in")) * (len(node.parts) + 2)


class _Checker:
    def __init__(
        self,
        text: str,
        find: Find,
        series: bool,
        metrics: Mapping[str, Quantity],
        pure_numbers: bool,
        functions: Sequence[str],
    ):
        self._text, self._find, self._series, self._metrics = text, find, series, metrics
        self._pure_numbers, self._functions = pure_numbers, functions
        self._values = self._depth = 0
        self._signs = self._nested = 0  # signs, `not` and `**` around a part; the most of them
        self._columns = False  # within a function of all ticks

    def root(self, e: ast.expr, condition: bool) -> Node:
        found = self._need_scalar(self.node(e))
        if found.operator == "literal" and found.quantity.kind is Kind.NAME:
            raise ExpressionError(f"`{found.text}` is a name by itself: compare it with a field")
        if self._nested + _parentheses(self._text) > DEPTH_MAX:
            raise ExpressionError(f"`{self._text}` is nested too deeply")
        return self.need_bool(found) if condition else found

    def node(self, e: ast.expr) -> Node:
        self._depth += 1
        if self._depth > _LEVELS_MAX:
            raise ExpressionError(f"`{self._text}` is nested too deeply")
        found = self._node(e)
        self._depth -= 1
        return found

    def _node(self, e: ast.expr) -> Node:
        if isinstance(e, ast.Constant | ast.Name | ast.Attribute | ast.Subscript):
            self._values += 1
            if self._values > VALUES_MAX:
                raise ExpressionError(f"`{self._text[:60]}…` is too long: it has more than {VALUES_MAX} values")
            return self._leaf(e)
        if isinstance(e, ast.BoolOp):
            parts = tuple(self.need_bool(self.node(part)) for part in e.values)
            return self._made(e, "and" if isinstance(e.op, ast.And) else "or", parts, Quantity(Kind.BOOL))
        if isinstance(e, ast.UnaryOp):
            return self._unary(e)
        if isinstance(e, ast.BinOp):
            return self._chain(e)
        if isinstance(e, ast.Compare):
            return self._compare(e)
        if isinstance(e, ast.Call) and isinstance(e.func, ast.Name) and not e.keywords:
            return self._call(e, e.func.id)
        raise self._wrong(e)

    def _made(
        self, e: ast.expr, operator: str, parts: tuple[Node, ...], quantity: Quantity, value: object = None
    ) -> Node:
        return Node(operator, self._source(e), quantity, parts, value)

    def _source(self, e: ast.expr) -> str:
        return ast.get_source_segment(self._text, e) or ast.unparse(e)

    def _wrong(self, e: ast.expr) -> ExpressionError:
        return ExpressionError(
            f"`{self._source(e)}` is neither path, number, name in quotes, arithmetic, comparison, and/or/not nor one of "
            f"{', '.join(self._functions)}"
        )

    # ---- values ---------------------------------------------------------------------------------------------------------

    def _leaf(self, e: ast.Constant | ast.Name | ast.Attribute | ast.Subscript) -> Node:
        if isinstance(e, ast.Constant):
            return self._literal(e, e.value)
        if isinstance(e, ast.Name) and e.id in WORDS:
            return self._literal(e, WORDS[e.id])
        if isinstance(e, ast.Name) and e.id in self._metrics:
            if self._columns:
                raise ExpressionError(
                    f"`{e.id}` is a metric, one number of a flight: no function of all ticks takes it"
                )
            return self._made(e, "metric", (), self._metrics[e.id], e.id)
        path = self._path(e)
        quantity = self._find(path)
        if len(quantity.shape) > 1:
            raise ExpressionError(f"`{path}` is a matrix: take one of its elements")
        return self._made(e, "column" if self._columns else "field", (), quantity, path)

    def _literal(self, e: ast.expr, value: object) -> Node:
        kinds = {bool: Kind.BOOL, int: Kind.INTEGER, float: Kind.FLOAT, str: Kind.NAME}
        if type(value) not in kinds:
            raise self._wrong(e)
        if isinstance(e, ast.Constant) and not _LITERAL.fullmatch(self._source(e)):
            raise ExpressionError(f"`{self._source(e)[:60]}`: write a number in decimal digits, a name in plain quotes")
        if type(value) is int and value >= 2**63:
            raise ExpressionError(f"`{self._source(e)[:60]}` does not fit 64 bits")
        return self._made(e, "literal", (), Quantity(kinds[type(value)]), value)

    def _path(self, e: ast.expr) -> str:
        whole, parts = e, []
        while not isinstance(e, ast.Name):
            if isinstance(e, ast.Attribute):
                parts.append(f".{e.attr}")
            elif isinstance(e, ast.Subscript):
                parts.append(f"[{self._index(e)}]")
            else:
                raise self._wrong(whole)
            e = e.value
        source = self._source(whole)
        if e.id in WORDS or not _PATH.fullmatch(source):
            raise self._wrong(whole)
        return e.id + "".join(reversed(parts))

    def _index(self, e: ast.Subscript) -> str:
        index = e.slice.elts if isinstance(e.slice, ast.Tuple) else [e.slice]
        numbers = [i.value for i in index if isinstance(i, ast.Constant) and type(i.value) is int]
        if len(numbers) != len(index) or not index:
            raise ExpressionError(f"`{self._source(e)}`: an index is a whole number from 0 on")
        return ", ".join(map(str, numbers))

    # ---- what a part must be ---------------------------------------------------------------------------------------------

    def need_bool(self, node: Node) -> Node:
        """Other values would make a condition true by accident."""
        self._need_scalar(node)
        if node.quantity.kind is not Kind.BOOL:
            compared = f"… == {node.text}" if node.operator == "literal" else f"{node.text} == …"
            what = node.quantity.kind.value
            raise ExpressionError(f"`{node.text}` is {what}, neither True nor False; compare it: `{compared}`")
        return node

    def _need_number(self, node: Node) -> Node:
        if node.quantity.kind not in _NUMBERS:
            raise ExpressionError(f"`{node.text}` is a name, not a number")
        return node

    def _need_scalar(self, node: Node) -> Node:
        if node.quantity.shape:
            raise ExpressionError(
                f"`{node.text}` is a vector of {node.quantity.shape[0]}: take one of its elements, or `norm`"
            )
        return node

    def _same_unit(self, parts: tuple[Node, ...], what: str) -> Unit | None:
        known = [part for part in parts if part.quantity.unit is not None]
        for part in known[1:]:
            first, other = known[0].quantity.unit, part.quantity.unit
            if first is not None and other is not None and first != other:
                both = f"`{known[0].text}` is in {_shown(first)} and `{part.text}` in {_shown(other)}"
                raise ExpressionError(f"{both}: {what} needs one unit; convert one of them")
        return known[0].quantity.unit if known else None

    def _shape(self, parts: tuple[Node, ...]) -> tuple[int, ...]:
        shapes = dict.fromkeys(part.quantity.shape for part in parts if part.quantity.shape)
        if len(shapes) > 1:
            texts = " and ".join(f"`{part.text}` of {part.quantity.shape[0]}" for part in parts if part.quantity.shape)
            raise ExpressionError(f"{texts} are vectors of different sizes")
        return next(iter(shapes), ())

    # ---- operators ------------------------------------------------------------------------------------------------------

    def _deeper(self, e: ast.expr) -> Node:
        self._signs += 1
        self._nested = max(self._nested, self._signs)
        found = self.node(e)
        self._signs -= 1
        return found

    def _unary(self, e: ast.UnaryOp) -> Node:
        part = self._deeper(e.operand)
        if isinstance(e.op, ast.Not):
            return self._made(e, "not", (self.need_bool(part),), Quantity(Kind.BOOL))
        if isinstance(e.op, ast.Invert):
            raise self._wrong(e)
        self._need_number(part)
        operator = "negative" if isinstance(e.op, ast.USub) else "positive"
        quantity = Quantity(_joined((part,)), part.quantity.shape, part.quantity.unit)
        return self._made(e, operator, (part,), quantity)

    def _chain(self, e: ast.BinOp) -> Node:
        """`a + b - c …` from the left: a loop, since such a chain may be long."""
        chain: list[ast.BinOp] = []
        first: ast.expr = e
        while isinstance(first, ast.BinOp):
            if type(first.op) not in _ARITHMETIC:
                raise self._wrong(first)
            chain.append(first)
            first = first.left
        left = self.node(first)
        for link in reversed(chain):
            right = self._deeper(link.right) if isinstance(link.op, ast.Pow) else self.node(link.right)
            left = self._arithmetic(link, _ARITHMETIC[type(link.op)], left, right)
        return left

    def _arithmetic(self, e: ast.BinOp, operator: str, left: Node, right: Node) -> Node:
        parts = (self._need_number(left), self._need_number(right))
        kind = Kind.FLOAT if operator in ("/", "**") else _joined(parts)
        a, b = left.quantity.unit, right.quantity.unit
        if self._pure_numbers and operator in ("*", "/", "//") and (a is None) != (b is None):
            a, b = (() if unit is None and _is_pure(part) else unit for unit, part in zip((a, b), parts, strict=True))
            unit = units.product(a, b, 1 if operator == "*" else -1)
        elif operator in ("+", "-", "%"):
            unit = self._same_unit(parts, f"`{operator}`")
        elif operator == "//":
            unit = None if self._same_unit(parts, "`//`") is None else ()
        elif operator == "**":
            exponent = right.value if right.operator == "literal" else None
            unit = units.power(a, Fraction(exponent)) if type(exponent) is int else None
        else:
            unit = units.product(a, b, 1 if operator == "*" else -1)
        return self._made(e, operator, parts, Quantity(kind, self._shape(parts), unit))

    def _compare(self, e: ast.Compare) -> Node:
        membership = [_MEMBERSHIP[type(op)] for op in e.ops if type(op) in _MEMBERSHIP]
        if membership:
            return self._member(e, membership[0])
        if any(type(op) not in _COMPARISONS for op in e.ops):
            raise self._wrong(e)
        parts = tuple(self._need_scalar(self.node(part)) for part in (e.left, *e.comparators))
        operators = tuple(_COMPARISONS[type(op)] for op in e.ops)
        for left, operator, right in zip(parts, operators, parts[1:], strict=False):
            self._need_comparable(left, operator, right)
        return self._made(e, "compare", parts, Quantity(Kind.BOOL), operators)

    def _member(self, e: ast.Compare, operator: str) -> Node:
        listed = e.comparators[0]
        if len(e.ops) > 1:
            raise ExpressionError(
                f"`{self._source(e)}`: write a chain with `{operator}` as two comparisons, joined by `and`"
            )
        if not isinstance(listed, ast.List | ast.Tuple) or not listed.elts:
            raise ExpressionError(
                f"`{self._source(listed)}` is no list: `{operator}` takes one, such as `('RUN', 'SAFE')`"
            )
        part = self._need_scalar(self.node(e.left))
        items = tuple(self._need_scalar(self.node(item)) for item in listed.elts)
        for item in items:
            self._need_comparable(part, "==", item)
        return self._made(e, operator, (part, *items), Quantity(Kind.BOOL))

    def _need_comparable(self, left: Node, operator: str, right: Node) -> None:
        names = [part.quantity.kind is Kind.NAME for part in (left, right)]
        if not any(names):
            self._same_unit((left, right), "a comparison")
            return
        if not all(names):
            both = f"`{left.text}` is {left.quantity.kind.value} and `{right.text}` {right.quantity.kind.value}"
            raise ExpressionError(f"{both}: they cannot be compared")
        if operator not in ("==", "!="):
            raise ExpressionError(f"`{left.text}` and `{right.text}` are names, which have no order")
        if left.operator == right.operator == "literal":
            raise ExpressionError(f"`{left.text}` and `{right.text}` are both constants: compare a name with a field")
        if "literal" not in (left.operator, right.operator) and left.quantity.names != right.quantity.names:
            raise ExpressionError(f"`{left.text}` and `{right.text}` are names of different kinds")
        for path, name in ((left, right), (right, left)):
            if name.operator == "literal" and path.quantity.names and name.value not in path.quantity.names:
                known = ", ".join(map(repr, path.quantity.names))
                hint = _hint(name.value, path.quantity.names)
                raise ExpressionError(f"`{path.text}` is never {name.value!r}: it is one of {known}{hint}")

    # ---- functions ------------------------------------------------------------------------------------------------------

    def _call(self, e: ast.Call, name: str) -> Node:
        if self._series and name in SERIES_FUNCTIONS and (len(e.args) == 1 or name not in FUNCTIONS):
            return self._series_call(e, name)
        if name not in self._functions:
            if name in SERIES_FUNCTIONS:
                raise ExpressionError(f"`{name}` is of all ticks of a flight: only metrics of a campaign have it")
            if name in PAST_FUNCTIONS:
                raise ExpressionError(f"`{name}` is of the ticks so far: only requirements have it")
            known = self._functions
            raise ExpressionError(f"there is no function `{name}`: there are {', '.join(known)}{_hint(name, known)}")
        if name in PAST_FUNCTIONS:
            return self._past_call(e, name)
        parts = tuple(self._need_number(self.node(argument)) for argument in e.args)
        many = name in ("min", "max")
        if (len(parts) < 2 or len(parts) > ARGUMENTS_MAX) if many else len(parts) != 1:
            takes = f"2 to {ARGUMENTS_MAX} values" if many else "1 value"
            raise ExpressionError(f"`{name}` takes {takes}, not {len(parts)}")
        return self._made(e, name, parts, self._function(name, parts))

    def _function(self, name: str, parts: tuple[Node, ...]) -> Quantity:
        first = parts[0].quantity
        if name == "norm":
            if not first.shape:
                raise ExpressionError(f"`norm` is of a vector, and `{parts[0].text}` is a scalar: `abs`")
            if first.shape[0] > VECTOR_MAX and not self._series:
                raise ExpressionError(f"`{parts[0].text}` has more than {VECTOR_MAX} elements")
            return Quantity(Kind.FLOAT, (), first.unit)
        if name in ("isnan", "isfinite"):
            self._need_scalar(parts[0])
            return Quantity(Kind.BOOL)
        if name == "sqrt":
            return Quantity(Kind.FLOAT, first.shape, units.power(first.unit, Fraction(1, 2)))
        if name == "degrees":
            if first.unit:
                raise ExpressionError(f"`degrees` is of rad, and `{parts[0].text}` is in {_shown(first.unit)}")
            return Quantity(Kind.FLOAT, first.shape, _DEGREE)
        return Quantity(_joined(parts), self._shape(parts), self._same_unit(parts, f"`{name}`"))

    def _past_call(self, e: ast.Call, name: str) -> Node:
        takes = PAST_FUNCTIONS[name]
        if len(e.args) != len(takes):
            listed = ", ".join(_PAST_EXAMPLES[kind] for kind in takes)
            raise ExpressionError(f"`{self._source(e)}`: `{name}` takes {listed}")
        given = zip(e.args, takes, strict=True)
        parts = tuple(self.node(argument) for argument, kind in given if kind != "s")
        if name != "previous":
            parts = tuple(map(self._need_scalar, parts))
        for part, kind in zip(parts, takes, strict=False):
            if kind == "p":
                self.need_bool(part)
            elif part.operator == "literal":
                raise ExpressionError(f"`{part.text}` is the same at all ticks: give `{name}` a path")
        if takes.startswith("p"):
            quantity = Quantity(Kind.BOOL)
        elif name == "previous":
            quantity = parts[0].quantity
        else:
            self._need_number(parts[0])
            quantity = Quantity(Kind.FLOAT, (), parts[0].quantity.unit)
        seconds = self._seconds(e.args[-1], name) if takes.endswith("s") else None
        return self._made(e, name, parts, quantity, seconds)

    def _seconds(self, e: ast.expr, name: str) -> Fraction:
        """A time as it is written, exactly."""
        text = self._source(e)
        is_number = isinstance(e, ast.Constant) and type(e.value) in (int, float)
        if not is_number or not _LITERAL.fullmatch(text) or not Fraction(text):
            raise ExpressionError(f"`{text}`: `{name}` takes a time in s, a positive number such as 0.5")
        return Fraction(text)

    def _series_call(self, e: ast.Call, name: str) -> Node:
        if self._columns:
            raise ExpressionError(f"`{name}` takes all ticks already: it cannot stand within another such function")
        if len(e.args) != 1:
            raise ExpressionError(f"`{name}` takes 1 value, not {len(e.args)}")
        self._columns = True
        part = self.node(e.args[0])
        self._columns = False
        if not any(inner.operator == "column" for inner in part.walk()):
            raise ExpressionError(f"`{name}` is of all ticks, so it needs a path")
        if name in CONDITIONS:
            if part.quantity.kind is not Kind.BOOL or part.quantity.shape:
                raise ExpressionError(f"`{name}` takes a condition, such as `{name}({part.text} > 0)`")
            is_time = name in ("time", "duration")
            return self._made(e, name, (part,), Quantity(Kind.FLOAT, (), _SECOND) if is_time else Quantity(Kind.BOOL))
        if name not in ("first", "last"):
            self._need_number(part)
        kept = part.quantity.kind if name in ("first", "last", "min", "max") else Kind.FLOAT
        return self._made(
            e, name, (part,), Quantity(kept, part.quantity.shape, part.quantity.unit, part.quantity.names)
        )


def _is_pure(node: Node) -> bool:
    """Whether it is made of literals alone."""
    return all(part.operator == "literal" for part in node.walk() if not part.parts)


def _joined(parts: tuple[Node, ...]) -> Kind:
    """Of a sum: a bool counts as 1 or 0."""
    return Kind.FLOAT if any(part.quantity.kind is Kind.FLOAT for part in parts) else Kind.INTEGER


def _shown(unit: Unit) -> str:
    return units.text(unit) if unit else "rad or 1"


def _hint(word: str, choices: Iterable[str]) -> str:
    meant = nearest(word, tuple(choices))
    return f"; {meant}" if meant else ""
