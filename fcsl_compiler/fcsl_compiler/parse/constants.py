# SPDX-License-Identifier: Apache-2.0
"""`constants` of a configuration: names with a value and a unit, and expressions of them in the place of numbers."""

from __future__ import annotations

import keyword
import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.diagnostics import nearest
from ..base.files import SourceError
from ..base.source import SourceFile, Span
from ..expression.evaluate import SCALARS, evaluator
from ..expression.parse import FUNCTIONS, WORDS, parse
from ..expression.tree import ExpressionError, Kind, Node, Quantity
from ..expression.units import Unit, read, text
from .json_source import JsonNode, parse_json
from .source_path import SourcePathError, missing_file_help, resolve_source

if TYPE_CHECKING:
    from .json_reader import ConfigReader

Number = int | float

HELP = "write a number, or an expression of the constants before it, such as `2 * track`"


class UnitError(ExpressionError):
    """The value of an expression has another unit than that which is needed."""

    def __init__(self, found: Unit, unit: str):
        super().__init__(f"its unit is {text(found)}, not {unit}")


class ReportedError(ExpressionError):
    """An expression reads a constant of which an error was reported."""


class Constants:
    """The constants of one file, in its order. `used`: those that a value reads, directly or by another one. `later`: those
    that follow. `wrong`: those with a reported error. `is_read`: False if the file of them could not be read."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[Number, Unit | None]] = {}
        self._of: dict[str, set[str]] = {}  # by name, the constants that its own value reads
        self.used: set[str] = set()
        self.later: set[str] = set()
        self.wrong: set[str] = set()
        self.is_read = True

    def add(self, name: str, expression: str | Number, unit: str) -> None:
        """Raises ExpressionError."""
        before = set(self.used)
        self.used.clear()
        value, found = self.evaluate(expression) if isinstance(expression, str) else (expression, None)
        read_by, self.used = self.used, before
        self._known[name] = value, read(unit) if unit else found
        self._of[name] = read_by
        _check_unit(found, unit)

    @property
    def known(self) -> dict[str, tuple[Number, Quantity]]:
        """Value and quantity of each by name."""
        return {name: (value, self._find(name)) for name, (value, _) in self._known.items() if name not in self.wrong}

    def value(self, expression: str, unit: str) -> Number:
        """Of an expression that has this unit, if it is not "". Raises ExpressionError."""
        value, found = self.evaluate(expression)
        _check_unit(found, unit)
        return value

    def evaluate(self, expression: str) -> tuple[Number, Unit | None]:
        """The value of an expression and its unit (None: any). Raises ExpressionError."""
        node = parse(expression, self._find, pure_numbers=True)
        if node.quantity.kind not in (Kind.INTEGER, Kind.FLOAT) or node.quantity.shape:
            raise ExpressionError(f"`{expression}` is no number")
        for name in (part.value for part in node.walk() if part.operator == "field"):
            self.used |= {name, *self._of[name]}
        value = evaluator(node, SCALARS)(self._value)
        assert isinstance(value, int | float)
        if not math.isfinite(value):
            raise ExpressionError(f"`{expression}` overflows: it is beyond the range of f64")
        return value, node.quantity.unit

    @property
    def used_texts(self) -> list[str]:
        """The constants that values read, for a hash: those that only another file uses are not among them."""
        known = [(name, *self._known[name]) for name in sorted(self.used)]
        return [f"{name} {value!r} {'' if unit is None else text(unit)}" for name, value, unit in known]

    def _find(self, name: str) -> Quantity:
        if not self.is_read or (name in self.wrong and name not in self._known):
            raise ReportedError
        if name in self.later:
            raise ExpressionError(f"the constant `{name}` is defined below: move it above")
        if name not in self._known:
            known = list(self._known)
            hint = nearest(name, known) or f"there are {', '.join(known)}" if known else "there are none"
            raise ExpressionError(f"there is no constant `{name}`; {hint}")
        value, unit = self._known[name]
        return Quantity(Kind.INTEGER if isinstance(value, int) else Kind.FLOAT, unit=unit)

    def _value(self, node: Node) -> Number:
        return self._known[node.value][0]


def read_constants(node: JsonNode | None, config: Path, reader: ConfigReader, outside: bool = False) -> Constants:
    """The `constants` of a configuration file: an object, or the name of a file that holds one, which may lie `outside` of
    the folder."""
    found = Constants()
    if node is not None and node.kind == "string":
        node = _file(str(node.value), node.span, config, reader, outside)
        found.is_read = node is not None and node.kind == "object"
    definitions = reader.named(node, "`constants`")
    found.later = set(definitions)
    for name, (definition, span) in definitions.items():
        found.later.discard(name)
        if reason := _reserved(name):
            reader.sink.error("E203", f"`{name}` cannot name a constant", span, why=reason, help="choose another name")
        expression, unit = definition, ""
        if definition.kind == "object":
            keys = reader.object(definition, f"constant `{name}`", ("value",), ("unit",)) or {}
            unit = _unit(keys.get("unit"), reader)
            if "value" not in keys:
                found.wrong.add(name)
                continue
            expression = keys["value"]
        value = expression.value
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            reader.wrong(expression, f"constant `{name}` is a number or an expression", '0.45, or "2 * track"')
            found.wrong.add(name)
            continue
        try:
            found.add(name, value, unit)
        except ExpressionError as error:
            found.wrong.add(name)
            report(error, f"constant `{name}`", span, HELP, reader)
    return found


def report(error: ExpressionError, what: str, span: Span, fix: str, reader: ConfigReader) -> None:
    """Reports what is wrong with an expression, unless that is a constant which is reported already."""
    if isinstance(error, UnitError):
        fix = "to convert it, multiply by a constant of such a unit as `m/mm`, or without one"
    if not isinstance(error, ReportedError):
        reader.sink.error("E252", f"{what}: {error}", span, help=fix)


def _check_unit(found: Unit | None, unit: str) -> None:
    if unit and found is not None and found != read(unit):
        raise UnitError(found, unit)


def _reserved(name: str) -> str:
    """Why no expression could read a constant of this name."""
    if name in FUNCTIONS:
        return "it is a function of expressions"
    return "it is a word of Python, whose syntax expressions have" if keyword.iskeyword(name) or name in WORDS else ""


def _unit(node: JsonNode | None, reader: ConfigReader) -> str:
    from ..model.types import is_unit  # here: an unchanged machine is found in the cache without its types

    unit = reader.string(node, "`unit`", "m") or ""
    if node is None or not unit or is_unit(unit):
        return unit
    reader.sink.error("E252", f"`{unit}` is not a unit", node.span, help="write it like `rad/s`, `m/s^2`, `N*m`")
    return ""


def _file(name: str, span: Span, config: Path, reader: ConfigReader, outside: bool) -> JsonNode | None:
    try:
        is_beside = outside and not name.startswith("package://")
        path = config.parent / name if is_beside else resolve_source(name, config=config)
        source = SourceFile.read(path, name)
    except (SourceError, SourcePathError) as error:
        fix = missing_file_help(error, span)
        reader.sink.error("E100", f"cannot read `{name[:200]}`: {error}", span, help=fix)
        return None
    return parse_json(source, reader.sink)
