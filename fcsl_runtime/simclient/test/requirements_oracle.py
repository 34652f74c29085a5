# SPDX-License-Identifier: Apache-2.0
"""Requirements by their definitions (docs/guide/requirements.md): whole histories, and no memory. Shares nothing with the
compiler: formulas are trees of tuples, which this file makes, writes as text and evaluates."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

Formula = tuple[Any, ...]
Values = dict[str, Any]
#: Kleene's third value, for what compares a NaN.
UNDEFINED = None

NUMBERS = ("src.outputs.x", "src.outputs.y", "slow.outputs.z", "src.outputs.v[1]", "other.outputs.w")
_INTEGERS = ("src.outputs.n", "src.outputs.u")
CONDITIONS = ("src.outputs.b",)
_CHANGE = ("-", ("field", "src.outputs.v"), ("previous", ("field", "src.outputs.v")))
_COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


class Generator:
    """Formulas at random."""

    def __init__(self, seed: int, tick_hz: int):
        self.random, self.tick_hz = random.Random(seed), tick_hz

    def seconds(self, most: int) -> float:
        return self.random.randint(1, most) / self.tick_hz

    def number(self, depth: int) -> Formula:
        kind = self.random.choice(("field", "field", "literal") if depth <= 0 else ("field", "op", "call", "past"))
        if kind == "field":
            return ("field", self.random.choice(NUMBERS))
        if kind == "literal":
            return ("literal", self.random.choice((0.0, 1.0, -1.5, 2.0)))
        if kind == "op":
            operator, left, right = self.random.choice("+-*/"), self.number(depth - 1), self.number(depth - 1)
            return (operator, left, right if operator != "/" or fields(right) else ("literal", 2.0))
        if kind == "call":
            name = self.random.choice(("abs", "min", "max", "negative", "norm"))
            if name == "norm":
                return ("norm", ("field", "src.outputs.v")) if self.random.random() < 0.5 else ("norm", _CHANGE)
            both = (
                (self.number(depth - 1),)
                if name in ("abs", "negative")
                else (self.number(depth - 1), self.number(depth - 1))
            )
            return (name, *both)
        name = self.random.choice(("previous", "max_over", "min_over"))
        part = ("field", self.random.choice(NUMBERS))
        if depth > 1 and self.random.random() < 0.3:
            part = ("+", part, self.number(0))
        return ("previous", part) if name == "previous" else (name, part, self.seconds(12))

    def integer(self, depth: int) -> Formula:
        if depth <= 0 or self.random.random() < 0.5:
            if self.random.random() < 0.7:
                return ("field", self.random.choice(_INTEGERS))
            return ("literal", self.random.randint(0, 3))
        return (self.random.choice(("+", "-", "min", "max")), self.integer(depth - 1), self.integer(depth - 1))

    def condition(self, depth: int) -> Formula:
        leaves = ("field", "compare", "compare", "chain", "integers", "mixed", "state", "health", "in", "isnan")
        kinds = leaves if depth <= 0 else (*leaves, *("and", "or", "not", "past", "past", "past"))
        kind = self.random.choice(kinds)
        if kind == "field":
            return ("field", CONDITIONS[0])
        if kind in ("compare", "chain"):
            count = 2 if kind == "compare" else 3
            operators = tuple(self.random.choice(_COMPARISONS) for _ in range(count - 1))
            return ("compare", operators, *(self.number(depth) for _ in range(count)))
        if kind == "integers":
            return ("compare", (self.random.choice(_COMPARISONS),), self.integer(depth), self.integer(depth))
        if kind == "mixed":
            return ("compare", (self.random.choice(_COMPARISONS),), self.integer(0), self.number(0))
        if kind == "state":
            states = self.random.choice((("A",), ("B",), ("C",), ("A", "B")))
            return ("in", ("field", "machine.state"), *(("literal", state) for state in states))
        if kind == "health":
            health = self.random.choice(("nominal", "failed", "stale"))
            return (
                "compare",
                (self.random.choice(("==", "!=")),),
                ("field", "slow.outputs.health"),
                ("literal", health),
            )
        if kind == "in":
            return (
                "in",
                self.integer(0),
                *(("literal", n) for n in sorted({self.random.randint(0, 3) for _ in range(2)})),
            )
        if kind == "isnan":
            return (self.random.choice(("isnan", "isfinite")), self.number(depth - 1))
        if kind in ("and", "or"):
            return (kind, *(self.condition(depth - 1) for _ in range(self.random.choice((2, 2, 3)))))
        if kind == "not":
            return ("not", self.condition(depth - 1))
        name = self.random.choice(("previous", "rose", "fell", "once", "since", "held", "within"))
        first = self.condition(depth - 1)
        if name in ("since", "within"):
            second = self.condition(depth - 1)
            return (name, first, second) if name == "since" else (name, first, second, self.seconds(6))
        return (name, first, self.seconds(6)) if name == "held" else (name, first)

    def root(self, depth: int) -> Formula:
        """A condition that reads a field, as a requirement must."""
        while not fields(found := self.condition(depth)):
            pass
        return found

    def requirement(self, id_: str) -> Values:
        kind = self.random.choice(("then", "then", "then", "never", "at_end"))
        found: Values = {"id": id_, "text": f"generated {id_}", kind: self.root(3)}
        if self.random.random() < 0.7:
            found["when"] = self.root(2)
            if kind == "then" and self.random.random() < 0.4:
                found["within_s"] = self.seconds(5)
        if self.random.random() < 0.25:
            found["clock"] = "slow"
        if self.random.random() < 0.25:
            found["stale"] = "hold"
        if kind != "at_end" and self.random.random() < 0.25:
            found["effect"] = {"degrade": "src"}  # no formula reads this health
        return found


def text(f: Formula) -> str:
    """As a requirement is written."""
    kind = f[0]
    if kind == "field":
        return str(f[1])
    if kind == "literal":
        return repr(f[1])
    if kind == "norm":
        return f"norm({text(f[1])})"
    if kind in ("+", "-", "*", "/"):
        return f"({text(f[1])} {kind} {text(f[2])})"
    if kind == "negative":
        return f"(-{text(f[1])})"
    if kind in ("and", "or"):
        return "(" + f" {kind} ".join(text(part) for part in f[1:]) + ")"
    if kind == "not":
        return f"(not {text(f[1])})"
    if kind == "compare":
        parts = [text(part) for part in f[2:]]
        return "(" + parts[0] + "".join(f" {op} {part}" for op, part in zip(f[1], parts[1:], strict=True)) + ")"
    if kind == "in":
        return f"({text(f[1])} in [{', '.join(text(item) for item in f[2:])}])"
    return f"{kind}({', '.join(repr(part) if isinstance(part, float) else text(part) for part in f[1:])})"


def written(requirement: Values) -> Values:
    return {key: text(value) if isinstance(value, tuple) else value for key, value in requirement.items()}


def fields(f: Formula) -> set[str]:
    if f[0] == "field":
        return {f[1]}
    return set().union(
        *(fields(part) for part in f[1:] if isinstance(part, tuple) and part and isinstance(part[0], str))
    )


# ---- Kleene's logic --------------------------------------------------------------------------------------------------


def negation(a: bool | None) -> bool | None:
    return None if a is None else not a


def conjunction(parts: Sequence[bool | None]) -> bool | None:
    return False if False in parts else UNDEFINED if UNDEFINED in parts else True


def disjunction(parts: Sequence[bool | None]) -> bool | None:
    return True if True in parts else UNDEFINED if UNDEFINED in parts else False


_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    **{"<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a, b: a >= b},
    **{"==": lambda a, b: a == b, "!=": lambda a, b: a != b},
}


def _is_nan(a: Any) -> bool:
    return isinstance(a, float) and math.isnan(a)


def _divide(a: float, b: float) -> float:
    if b == 0.0:
        return math.nan if a == 0.0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


def _better(values: Sequence[float], sign: float) -> float:
    if any(_is_nan(v) for v in values):
        return math.nan
    return max(values, key=lambda v: sign * v)


class History:
    """The evaluations of a requirement since it last began anew: their ticks and values."""

    def __init__(self, tick_hz: int):
        self.tick_hz = tick_hz
        self.ticks: list[int] = []
        self.values: list[Values] = []
        self._known: dict[tuple[int, int], Any] = {}  # a formula has one value at an evaluation

    def at(self, f: Formula, i: int) -> Any:
        """The value of a formula at evaluation i."""
        key = id(f), i
        if key not in self._known:
            self._known[key] = self._value(f, i)
        return self._known[key]

    def _value(self, f: Formula, i: int) -> Any:
        kind = f[0]
        if kind == "field":
            return self.values[i][f[1]]
        if kind == "literal":
            return f[1]
        if kind == "norm":
            return math.sqrt(sum(v * v for v in self.at(f[1], i)))
        if kind == "compare":
            parts = [self.at(part, i) for part in f[2:]]
            pairs = zip(f[1], parts, parts[1:], strict=False)
            return conjunction([UNDEFINED if _is_nan(a) or _is_nan(b) else _COMPARE[op](a, b) for op, a, b in pairs])
        if kind == "in":
            return self.at(f[1], i) in [item[1] for item in f[2:]]
        if kind in ("isnan", "isfinite"):
            return getattr(math, kind)(self.at(f[1], i))
        if kind in ("and", "or"):
            return (conjunction if kind == "and" else disjunction)([self.at(part, i) for part in f[1:]])
        if kind == "not":
            return negation(self.at(f[1], i))
        if kind in _PAST:
            return _PAST[kind](self, f, i)
        a = self.at(f[1], i)
        if kind in ("abs", "negative"):
            return abs(a) if kind == "abs" else -a
        b = self.at(f[2], i)
        if isinstance(a, list):
            return [x - y for x, y in zip(a, b, strict=True)]
        if kind in ("min", "max"):
            if isinstance(a, int) and isinstance(b, int):
                return min(a, b) if kind == "min" else max(a, b)
            return _better([a, b], -1.0 if kind == "min" else 1.0)
        return _divide(a, b) if kind == "/" else a + b if kind == "+" else a - b if kind == "-" else a * b

    def _window(self, i: int, seconds: float) -> list[int]:
        ticks = round(seconds * self.tick_hz)
        return [j for j in range(i + 1) if self.ticks[j] >= self.ticks[i] - ticks]

    def _previous(self, f: Formula, i: int) -> Any:
        return self.at(f[1], max(i - 1, 0))

    def _rose(self, f: Formula, i: int) -> bool | None:
        return conjunction([self.at(f[1], i), negation(self.at(f[1], max(i - 1, 0)))])

    def _fell(self, f: Formula, i: int) -> bool | None:
        return conjunction([negation(self.at(f[1], i)), self.at(f[1], max(i - 1, 0))])

    def _once(self, f: Formula, i: int) -> bool | None:
        return disjunction([self.at(f[1], j) for j in range(i + 1)])

    def _since(self, f: Formula, i: int) -> bool | None:
        return disjunction(
            [conjunction([self.at(f[2], j), *(self.at(f[1], k) for k in range(j + 1, i + 1))]) for j in range(i + 1)]
        )

    def _held(self, f: Formula, i: int) -> bool | None:
        ticks = round(f[2] * self.tick_hz)
        if self.ticks[0] > self.ticks[i] - ticks:
            return False
        return conjunction([self.at(f[1], j) for j in self._window(i, f[2])])

    def _within(self, f: Formula, i: int) -> bool | None:
        ticks = round(f[3] * self.tick_hz)
        late = [j for j in range(i + 1) if self.ticks[j] <= self.ticks[i] - ticks]
        return negation(
            disjunction(
                [conjunction([self.at(f[1], j), *(negation(self.at(f[2], k)) for k in range(j, i + 1))]) for j in late]
            )
        )

    def _max_over(self, f: Formula, i: int) -> float:
        return _better([self.at(f[1], j) for j in self._window(i, f[2])], 1.0)

    def _min_over(self, f: Formula, i: int) -> float:
        return _better([self.at(f[1], j) for j in self._window(i, f[2])], -1.0)


_PAST: dict[str, Callable[[History, Formula, int], Any]] = {
    name: getattr(History, f"_{name}")
    for name in ("previous", "rose", "fell", "once", "since", "held", "within", "max_over", "min_over")
}


# ---- verdicts --------------------------------------------------------------------------------------------------------


@dataclass
class Expected:
    """What a verdict counts."""

    holds: bool = False
    evaluated: int = 0
    exercised: int = 0
    undefined: int = 0
    violations: int = 0
    violated_ticks: int = 0
    first_tick: int | None = None
    last_tick: int | None = None
    asked: bool = False  # of `at_end`: in the last tick


def verdict(requirement: Values, ticks: Sequence[Values], tick_hz: int) -> Expected:
    """`ticks`: what each tick left, and in `ran` the instances that completed a run in it."""
    kind = next(key for key in ("then", "never", "at_end") if key in requirement)
    condition, when = requirement[kind], requirement.get("when")
    read = {path for path in fields(condition) | (fields(when) if when else set()) if not path.endswith(".health")}
    instances = {path.partition(".")[0] for path in read} - {"machine"}
    instances |= {requirement["clock"]} if "clock" in requirement else set()
    grace = round(requirement.get("within_s", 0.0) * tick_hz)
    found, history, violated = Expected(), History(tick_hz), False
    wrong_from: int | None = None
    for tick, values in enumerate(ticks):
        stale = any(values[f"{name}.outputs.health"] == "stale" for name in instances)
        if stale and requirement.get("stale") != "hold":
            history, violated = History(tick_hz), False
            found.asked = found.asked and "clock" in requirement
            continue
        if "clock" in requirement and requirement["clock"] not in values["ran"]:
            continue
        begins = not history.ticks
        history.ticks.append(tick)
        history.values.append(values)
        i = len(history.ticks) - 1
        found.evaluated += 1
        truth = history.at(condition, i)
        kept = (negation(truth) if kind == "never" else truth) is True
        asked = True if when is None else history.at(when, i)
        found.exercised += asked is True
        found.undefined += asked is UNDEFINED
        wrong = asked is True and not kept
        if kind == "at_end":
            found.asked, found.holds = asked is True, not wrong
            continue
        if not wrong:
            wrong_from = None
        elif wrong_from is None or begins:
            wrong_from = tick
        wrong = wrong_from is not None and tick - wrong_from >= grace
        if wrong:
            found.violations += not violated or begins
            found.violated_ticks += 1
            found.first_tick = tick if found.first_tick is None else found.first_tick
            found.last_tick = tick
        violated, found.holds = wrong, not wrong
    return found
