# SPDX-License-Identifier: Apache-2.0
"""An algorithm of the language that evaluates one requirement: its inputs are fields of the machine, its state is what
it remembers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..expression.tree import Kind, Node
from ..model.machine import Machine
from .code import Code, Truth
from .past import PastWriter
from .read import Signals
from .requirement import Requirement

_TYPES = {f"FCSL_{name.upper()}": name for name in ("bool", "i32", "i64", "u32", "u64", "f32", "f64")}
_STALE = 3

_HEAD = '''\
"""{what} of `{name}`: made by fcslc. Do not edit."""


def least(a: f64, b: f64) -> f64:
    """The smaller one; NaN, if one is."""
    return b if b < a or isnan(b) else a


def greatest(a: f64, b: f64) -> f64:
    """The larger one; NaN, if one is."""
    return b if b > a or isnan(b) else a
'''


def file_head(what: str, name: str) -> str:
    """What a file of such algorithms begins with: its docstring, and the functions that they call."""
    return _HEAD.format(what=what, name=name)


@dataclass
class AlgorithmWriter:
    """Writes the algorithm of one requirement. A subclass says what it does with the verdict."""

    requirement: Requirement
    machine: Machine
    inputs: dict[str, tuple[str, str]] = field(default_factory=dict)  # name and type by path
    values: list[str] = field(default_factory=list)  # the inputs that its conditions read

    def __post_init__(self) -> None:
        self.signals = Signals(self.machine)

    @property
    def class_name(self) -> str:
        return f"Monitor_{self.requirement.instance}"

    def outputs(self) -> Mapping[str, str]:
        """Their types by name."""
        raise NotImplementedError

    def verdict(self, when: Truth | None, wrong: list[str]) -> list[str]:
        """The statements of an evaluation. `wrong`: those that set `wrong`, whether the requirement is violated."""
        raise NotImplementedError

    def interrupted(self) -> list[str]:
        """The statements of a tick in which a stale instance has no value."""
        return ["self.started = False"]

    def state(self) -> Mapping[str, str]:
        """What the verdict remembers: types by name."""
        return {}

    def _input(self, path: str, name: str, type_: str = "") -> str:
        """The value of a field of the machine: `self.value_3`."""
        if path not in self.inputs:
            self.inputs[path] = (name, type_ or _TYPES.get(self.signals.find(path).row.abi_type, "i32"))
        return f"self.{self.inputs[path][0]}"

    def _read(self, node: Node, element: int) -> str:
        path = str(node.value)
        if node.quantity.shape:
            path = f"{path[:-1]},{element}]" if path.endswith("]") else f"{path}[{element}]"
        number = sum(name.startswith("value_") for name, _ in self.inputs.values())
        text = self._input(path, f"value_{number}")
        if text not in self.values and text.startswith("self.value_"):
            self.values.append(text)
        if node.quantity.kind is Kind.FLOAT and self.inputs[path][1] == "f32":
            return f"f64({text})"
        return text

    def text(self) -> str:
        r = self.requirement
        ticks = self._input("machine.tick", "ticks", "i64")  # the same bits for 10^18 ticks, and no conversion may fail
        past = PastWriter(self.machine.tick_hz)
        code = Code(self._read, past.locals)
        for root in r.expressions:
            past.add(root, code)
        when = code.truth(r.when) if r.when is not None else None
        condition = code.truth(r.condition)
        if r.kind == "never":
            condition = condition.negated
        body = [*past.lines, *self.verdict(when, self._wrong(when, condition))]
        named = [] if r.hold else list(enumerate(self.signals.instances(r)))
        guards = [f"{self._input(f'{name}.outputs.health', f'health_{n}')} == {_STALE}" for n, name in named]
        due = self._due()
        lines = [f"tick = wrap_sub({ticks}, 1)"]  # which cannot fault, so that the memory needs no copy to restore
        lines += ["if self.last_tick != wrap_sub(tick, 1):", "    self.started = False"]
        if r.clock is not None:
            faults = self._input(f"{r.clock}.counters.faults", "faults")
            lines += ["    if tick > 0:", f"        self.faults_before = {faults}"]
            lines += [f"completed = {faults} == self.faults_before", f"self.faults_before = {faults}"]
        lines.append("self.last_tick = tick")
        if guards:
            lines += [f"if {' or '.join(guards)}:", *[f"    {line}" for line in self.interrupted()]]
            lines += ["else:"]
            lines += [f"    {line}" for line in self._when_due(due, body)]
        else:
            lines += self._when_due(due, body)
        state = {"last_tick": "i64", "started": "bool", **past.state}
        if r.clock is not None:
            state["faults_before"] = "u64"
        if r.within_ticks:
            state["late_from"] = "i64"
        return self._class({**state, **self.state()}, lines)

    def _when_due(self, due: list[str], body: list[str]) -> list[str]:
        evaluate = ["restarted = not self.started", "self.started = True", *body]
        if not due:
            return evaluate
        return [f"if completed and ({' or '.join(due)}):", *[f"    {line}" for line in evaluate]]

    def _due(self) -> list[str]:
        """Conditions of which one holds in a tick in which the clock's instance ran."""
        if self.requirement.clock is None:
            return []
        state = self._input("machine.state", "active_state")
        index = next(n for n, i in enumerate(self.machine.instances) if i.name == self.requirement.clock)
        return [
            f"({state} == {number} and tick % {entry.divisor} == {entry.phase})"
            for number, s in enumerate(self.machine.states)
            for entry in s.entries
            if entry.instance == index
        ] or ["False"]

    def _wrong(self, when: Truth | None, condition: Truth) -> list[str]:
        lines = [f"holds = {condition.true}"]
        if when is None:
            lines.append("wrong = not holds")
        else:
            lines += [f"when_true = {when.true}", "wrong = when_true and not holds"]
        if self.requirement.within_ticks:
            lines += ["if not wrong:", "    self.late_from = -1"]
            lines += ["elif self.late_from < 0 or restarted:", "    self.late_from = tick"]
            lines += [f"wrong = wrong and wrap_sub(tick, self.late_from) >= {self.requirement.within_ticks}"]
        return lines

    def _class(self, state: Mapping[str, str], lines: list[str]) -> str:
        types = dict(self.inputs.values())
        text = [f"class {self.class_name}:", f'    """{_comment(self.requirement.text)}"""', ""]
        for record, fields in (("inputs", types), ("outputs", self.outputs()), ("state", state)):
            text += [
                f"    {record} = {{",
                *[f'        "{name}": "{type_}",' for name, type_ in fields.items()],
                "    }",
            ]
        text += ["    parameters = {}", "", "    def execute(self):"]
        return "\n".join([*text, *[f"        {line}" for line in lines]]) + "\n"


def _comment(text: str) -> str:
    """A text that ends no docstring."""
    return "".join(c if c.isprintable() and c not in '"\\' else "'" if c == '"' else "/" for c in text)
