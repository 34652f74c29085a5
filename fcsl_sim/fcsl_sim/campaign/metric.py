# SPDX-License-Identifier: Apache-2.0
"""What a campaign measures in a flight: expressions over paths, in Python syntax, which are parsed but never executed.

max(abs(body.outputs.rate_body[0]))          the largest value of all ticks
lander.outputs.touchdown_speed               a path by itself: its last value
time(machine.state == 'SAFE')                when that began, s; NaN: never
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from simclient.descriptor import Machine
from simclient.errors import TwinError
from simclient.paths import Selection, resolve
from simclient.twin.trace import Columns
from simclient.values import check_name, enumerators

Array = np.ndarray[Any, Any]
#: A value at every tick, or a number.
_Series = Callable[[Columns, Mapping[str, Any]], Any]

_MAX_NODES = 200
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: np.float_power,  # of integers Python would make one with any number of digits
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: np.logical_not,
}
_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
#: Of one value each; an array of a field keeps its shape.
_ELEMENTWISE: dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "isnan": np.isnan,
    "minimum": np.minimum,
    "maximum": np.maximum,
    "degrees": np.degrees,
}
#: Of all ticks.
_REDUCTIONS: dict[str, Callable[[Array, float], Any]] = {
    "first": lambda x, _: x[0],
    "last": lambda x, _: x[-1],
    "min": lambda x, _: x.min(axis=0),
    "max": lambda x, _: x.max(axis=0),
    "mean": lambda x, _: x.mean(axis=0),
    "std": lambda x, _: x.std(axis=0),
    "rms": lambda x, _: np.sqrt(np.square(x).mean(axis=0)),
    "any": lambda x, _: x.any(),
    "all": lambda x, _: x.all(),
    "time": lambda x, dt: float(np.argmax(x)) * dt if x.any() else np.nan,
    "duration": lambda x, dt: float(np.count_nonzero(x)) * dt,
}
_CONDITIONS = ("any", "all", "time", "duration")
FUNCTIONS = (*_ELEMENTWISE, "norm", *_REDUCTIONS)


class MetricError(ValueError):
    """The expression, or a part of it, is wrong."""


class Metric:
    """An expression. `paths` are what it reads, `names` the other metrics it reads; `all_ticks`: not only the last values.

    names: of the metrics that it may use. Raises MetricError.
    """

    def __init__(self, text: str, machine: Machine, names: tuple[str, ...] = ()):
        self.text = text
        self._machine = machine
        self._known = names
        self.paths: set[str] = set()
        self.names: set[str] = set()
        self.all_ticks = False
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            raise MetricError(f"`{text}` is no expression: {error}") from None
        if sum(1 for _ in ast.walk(tree)) > _MAX_NODES:
            raise MetricError(f"`{text}` is too long: write parts of it as metrics of their own")
        self.tree = tree
        self._value = self._node(tree, within=False)

    def __call__(self, columns: Columns, metrics: Mapping[str, Any]) -> float | bool:
        """Its value in a flight. Raises MetricError if it is no single number."""
        with np.errstate(all="ignore"):
            try:
                value = np.asarray(self._value(columns, metrics))
            except (TypeError, ValueError, ZeroDivisionError, OverflowError) as error:
                raise MetricError(f"`{self.text}` cannot be evaluated: {error}") from None
        if value.shape != () or value.dtype.kind not in "bif":
            what = f"an array of shape {value.shape}" if value.shape else f"`{value}`"
            raise MetricError(f"`{self.text}` is {what}, not a number: take an element, or `norm`")
        return bool(value) if value.dtype.kind == "b" else float(value)

    def part(self, node: ast.expr, columns: Columns, metrics: Mapping[str, Any]) -> Any:
        """The value of a part of `tree` in a flight."""
        with np.errstate(all="ignore"):
            return self._node(node, within=False)(columns, metrics)

    def text_of(self, node: ast.expr) -> str:
        return ast.get_source_segment(self.text.strip(), node) or ast.unparse(node)

    # ---- parsing --------------------------------------------------------------------------------------------------------

    def _node(self, node: ast.expr, within: bool) -> _Series:
        """`within` a reduction a path is its column, outside the last value of that."""
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float | str):
            constant = node.value
            return lambda columns, metrics: constant
        if isinstance(node, ast.Name) and node.id in ("true", "false"):
            truth = node.id == "true"
            return lambda columns, metrics: truth
        if isinstance(node, ast.Name) and node.id in self._known:
            return self._metric(node, within)
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
            return self._path(node, within)
        if isinstance(node, ast.BoolOp):
            parts = [self._node(part, within) for part in node.values]
            join = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
            return lambda columns, metrics: _fold(join, [part(columns, metrics) for part in parts])
        if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            apply, operand = _UNARY[type(node.op)], self._node(node.operand, within)
            return lambda columns, metrics: apply(operand(columns, metrics))
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            combine = _BINARY[type(node.op)]
            left, right = self._node(node.left, within), self._node(node.right, within)
            return lambda columns, metrics: combine(left(columns, metrics), right(columns, metrics))
        if isinstance(node, ast.Compare) and all(type(op) in _COMPARISONS for op in node.ops):
            return self._comparison(node, within)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            return self._call(node, node.func.id, within)
        raise self._wrong(node)

    def _wrong(self, node: ast.expr) -> MetricError:
        return MetricError(
            f"`{self.text_of(node)}` is neither path, number, name in quotes, arithmetic, comparison, and/or/not nor one of "
            f"{', '.join(FUNCTIONS)}"
        )

    def _metric(self, node: ast.Name, within: bool) -> _Series:
        if within:
            raise MetricError(f"`{node.id}` is a metric, one number of a flight: no function of all ticks takes it")
        self.names.add(node.id)
        return lambda columns, metrics: metrics[node.id]

    def _path(self, node: ast.expr, within: bool) -> _Series:
        path = self._path_text(node)
        try:
            part = resolve(path, self._machine)
        except TwinError as error:
            raise MetricError(str(error)) from None
        if not isinstance(part, Selection):
            raise MetricError(f"`{path}` is a struct: name one of its fields")
        self.paths.add(part.field.path)
        self.all_ticks |= within
        return lambda columns, metrics: columns[path] if within else columns[path][-1]

    def _path_text(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name):
            return node.id
        if isinstance(node, ast.Attribute):
            return f"{self._path_text(node.value)}.{node.attr}"
        if isinstance(node, ast.Subscript):
            index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            numbers = [i.value for i in index if isinstance(i, ast.Constant) and type(i.value) is int]
            if len(numbers) == len(index):
                return f"{self._path_text(node.value)}[{', '.join(map(str, numbers))}]"
        raise self._wrong(node)

    def _comparison(self, node: ast.Compare, within: bool) -> _Series:
        operands = [node.left, *node.comparators]
        for left, right in zip(operands, operands[1:], strict=False):
            self._check_names(left, right)
            self._check_names(right, left)
        values = [self._node(operand, within) for operand in operands]
        compare = [_COMPARISONS[type(op)] for op in node.ops]

        def holds(columns: Columns, metrics: Mapping[str, Any]) -> Any:
            found = [value(columns, metrics) for value in values]
            return _fold(np.logical_and, [op(a, b) for op, a, b in zip(compare, found, found[1:], strict=False)])

        return holds

    def _check_names(self, path: ast.expr, name: ast.expr) -> None:
        """Refuses a name of a state or health that there is not, which would never match."""
        if not (isinstance(name, ast.Constant) and isinstance(path, ast.Name | ast.Attribute | ast.Subscript)):
            return
        if isinstance(path, ast.Name) and path.id in self._known:
            return
        try:
            leaf = resolve(self._path_text(path), self._machine)
            if isinstance(leaf, Selection) and enumerators(leaf.field.type, self._machine):
                check_name(name.value, leaf.field, leaf.path, self._machine)
        except TwinError as error:
            raise MetricError(str(error)) from None

    def _call(self, node: ast.Call, name: str, within: bool) -> _Series:
        if name in _ELEMENTWISE:
            function = _ELEMENTWISE[name]
            values = [self._node(argument, within) for argument in node.args]
            wanted = 2 if name in ("minimum", "maximum") else 1
            if len(values) != wanted:
                raise MetricError(f"`{name}` takes {wanted} value{'s' * (wanted > 1)}, not {len(values)}")
            return lambda columns, metrics: function(*[value(columns, metrics) for value in values])
        if name != "norm" and name not in _REDUCTIONS:
            raise MetricError(f"there is no function `{name}`: there are {', '.join(FUNCTIONS)}")
        if len(node.args) != 1:
            raise MetricError(f"`{name}` takes 1 value, not {len(node.args)}")
        if name == "norm":
            vector = self._node(node.args[0], within)
            return lambda columns, metrics: np.sqrt(np.square(vector(columns, metrics)).sum(axis=-1))
        if within:
            raise MetricError(f"`{name}` takes all ticks already: it cannot stand within another such function")
        series, reduce = self._node(node.args[0], True), _REDUCTIONS[name]
        if not self.all_ticks:
            raise MetricError(f"`{name}` is of all ticks, so it needs a path")

        def reduced(columns: Columns, metrics: Mapping[str, Any]) -> Any:
            values = np.asarray(series(columns, metrics))
            if name in _CONDITIONS and values.dtype.kind != "b":
                raise MetricError(f"`{name}` takes a condition, such as `{name}(… > 0)`")
            return reduce(values, 1.0 / columns.machine.tick_hz)

        return reduced


def _fold(join: Callable[[Any, Any], Any], values: list[Any]) -> Any:
    found = values[0]
    for value in values[1:]:
        found = join(found, value)
    return found
