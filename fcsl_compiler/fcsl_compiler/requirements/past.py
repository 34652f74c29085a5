# SPDX-License-Identifier: Apache-2.0
"""The operators of the past, as statements of the language that keep what they need in `state`.

Their definitions are those of docs/guide/requirements.md; with memory for a fixed number of values, and a bounded number of
operations in each tick.
"""

from __future__ import annotations

from ..expression.parse import PAST_FUNCTIONS
from ..expression.tree import Kind, Node
from .code import Code, Truth


class PastWriter:
    """`lines`: statements in order of evaluation. `state`: their memory. `locals`: by id of a node the local variable that
    holds its value."""

    def __init__(self, tick_hz: int):
        self._tick_hz = tick_hz
        self.lines: list[str] = []
        self.state: dict[str, str] = {}
        self.locals: dict[int, str] = {}

    def add(self, node: Node, code: Code) -> None:
        """Writes all operators of the past in an expression, inner ones first."""
        for part in node.parts:
            self.add(part, code)
        if node.operator in PAST_FUNCTIONS:
            name = f"{node.operator}_{len(self.locals)}"
            getattr(self, f"_{node.operator}")(node, name, code)
            self.locals[id(node)] = name

    def _ticks(self, node: Node) -> int:
        return int(node.value * self._tick_hz)

    def _keep(self, name: str, type_: str) -> str:
        self.state[name] = type_
        return f"self.{name}"

    def _now(self, name: str, truth: Truth) -> None:
        self.lines += [f"{name}_now = {truth.true}", f"{name}_not = {truth.false}"]

    # ---- the last tick ----------------------------------------------------------------------------------------------

    def _previous(self, node: Node, name: str, code: Code) -> None:
        (part,) = node.parts
        if part.quantity.kind is Kind.BOOL:
            self._before(part, name, code)
            self.lines += [f"{name}_true = {name}_was", f"{name}_false = {name}_was_not"]
            return
        kind = part.quantity.kind
        type_ = {Kind.FLOAT: "f64", Kind.NAME: "i32"}.get(kind, "i64")
        for element in range(part.quantity.shape[0] if part.quantity.shape else 1):
            own = f"{name}_{element}" if part.quantity.shape else name
            value = code.name(part) if kind is Kind.NAME else code.scalar(part, element)
            kept = self._keep(own, type_)
            self.lines += [f"{own}_now = {value}", f"{own} = {own}_now if restarted else {kept}", f"{kept} = {own}_now"]

    def _before(self, part: Node, name: str, code: Code) -> None:
        """Locals `_now`, `_not`, and those of the last evaluation, `_was`, `_was_not`: the same in the first one."""
        was, was_not = self._keep(f"{name}_kept", "bool"), self._keep(f"{name}_kept_not", "bool")
        self._now(name, code.truth(part))
        self.lines += [f"{name}_was = {name}_now if restarted else {was}"]
        self.lines += [f"{name}_was_not = {name}_not if restarted else {was_not}"]
        self.lines += [f"{was} = {name}_now", f"{was_not} = {name}_not"]

    def _rose(self, node: Node, name: str, code: Code) -> None:
        self._before(node.parts[0], name, code)
        self.lines += [f"{name}_true = {name}_now and {name}_was_not", f"{name}_false = {name}_not or {name}_was"]

    def _fell(self, node: Node, name: str, code: Code) -> None:
        self._before(node.parts[0], name, code)
        self.lines += [f"{name}_true = {name}_not and {name}_was", f"{name}_false = {name}_now or {name}_was_not"]

    # ---- all ticks so far -------------------------------------------------------------------------------------------

    def _once(self, node: Node, name: str, code: Code) -> None:
        self._recur(name, code.truth(node.parts[0]), Truth("True", "False"))

    def _since(self, node: Node, name: str, code: Code) -> None:
        self._recur(name, code.truth(node.parts[1]), code.truth(node.parts[0]))

    def _recur(self, name: str, begun: Truth, lasts: Truth) -> None:
        """S = begun or (lasts and S of the last evaluation), which is false in the first one."""
        true, false = self._keep(f"{name}_kept", "bool"), self._keep(f"{name}_kept_not", "bool")
        self._now(name, begun)
        self.lines += ["if restarted:", f"    {true} = False", f"    {false} = True"]
        self.lines += [f"{true} = {name}_now or ({lasts.true} and {true})"]
        self.lines += [f"{false} = {name}_not and ({lasts.false} or {false})"]
        self.lines += [f"{name}_true = {true}", f"{name}_false = {false}"]

    # ---- times ------------------------------------------------------------------------------------------------------

    def _held(self, node: Node, name: str, code: Code) -> None:
        ticks = self._ticks(node)
        unsure, wrong = self._keep(f"{name}_not_true", "i64"), self._keep(f"{name}_false", "i64")
        self._now(name, code.truth(node.parts[0]))
        self.lines += ["if restarted:", f"    {unsure} = wrap_sub(tick, 1)", f"    {wrong} = wrap_sub(tick, 1)"]
        self.lines += [f"if not {name}_now:", f"    {unsure} = tick", f"if {name}_not:", f"    {wrong} = tick"]
        self.lines += [
            f"{name}_true = {unsure} < wrap_sub(tick, {ticks})",
            f"{name}_false = {wrong} >= wrap_sub(tick, {ticks})",
        ]

    def _within(self, node: Node, name: str, code: Code) -> None:
        ticks = self._ticks(node)
        sure, maybe = self._keep(f"{name}_sure", "i64"), self._keep(f"{name}_maybe", "i64")
        self._now(name, code.truth(node.parts[0]))
        self._now(f"{name}_response", code.truth(node.parts[1]))
        self.lines += ["if restarted:", f"    {sure} = -1", f"    {maybe} = -1"]
        self.lines += [f"if {name}_now and {sure} < 0:", f"    {sure} = tick"]
        self.lines += [f"if not {name}_not and {maybe} < 0:", f"    {maybe} = tick"]
        self.lines += [f"if not {name}_response_not:", f"    {sure} = -1"]
        self.lines += [f"if {name}_response_now:", f"    {maybe} = -1"]
        self.lines += [f"{name}_true = {maybe} < 0 or {maybe} > wrap_sub(tick, {ticks})"]
        self.lines += [f"{name}_false = {sure} >= 0 and {sure} <= wrap_sub(tick, {ticks})"]

    def _max_over(self, node: Node, name: str, code: Code) -> None:
        self._extreme(node, name, code, "greatest", "-inf")

    def _min_over(self, node: Node, name: str, code: Code) -> None:
        self._extreme(node, name, code, "least", "inf")

    def _extreme(self, node: Node, name: str, code: Code, better: str, none: str) -> None:
        """A value for each tick of the window, and over them a tree of the better one of two: a new value changes one on each
        level."""
        ticks = self._ticks(node)
        levels = max(ticks, 1).bit_length()
        size = 1 << levels
        kept = [self._keep(f"{name}_{level}", f"f64[{size >> level}]") for level in range(levels + 1)]
        last = self._keep(f"{name}_last", "i64")
        self.lines += ["if restarted:"]
        for level, array in enumerate(kept):
            self.lines += [f"    for i in range({size >> level}):", f"        {array}[i] = {none}"]
        self.lines += [f"    {last} = wrap_sub(tick, 1)"]
        # The place of a tick is that of the tick that leaves the window. Those that were not evaluated leave nothing.
        self.lines += [f"for j in range(1, {ticks + 2}):", f"    if wrap_add({last}, j) >= tick:", "        break"]
        gone = f"{name}_gone = wrap_add({last}, j) % {ticks + 1}"
        self.lines += [f"    {line}" for line in (gone, *self._put(f"{name}_gone", kept, none, better))]
        value = code.number(node.parts[0])
        self.lines += [f"{name}_at = tick % {ticks + 1}", *self._put(f"{name}_at", kept, value, better)]
        self.lines += [f"{last} = tick", f"{name} = {kept[-1]}[0]"]

    def _put(self, at: str, kept: list[str], value: str, better: str) -> list[str]:
        """`at`: a local that is assigned once, so that no index can be outside."""
        lines = [f"{kept[0]}[{at}] = {value}"]
        for level, (below, array) in enumerate(zip(kept, kept[1:], strict=False), 1):
            pair = f"{at} // {1 << level}"
            lines.append(f"{array}[{pair}] = {better}({below}[{pair} * 2], {below}[{pair} * 2 + 1])")
        return lines
