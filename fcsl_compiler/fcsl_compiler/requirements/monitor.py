# SPDX-License-Identifier: Apache-2.0
"""The monitor of a machine: a machine of its own with an instance for each requirement, in the language itself.

Its inputs are fields of the machine that it watches, which a host copies after each tick. It changes nothing of it.
"""

from __future__ import annotations

import json
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
"""A requirement of `{name}`: made by fcslc. Do not edit."""


def least(a: f64, b: f64) -> f64:
    """The smaller one; NaN, if one is."""
    return b if b < a or isnan(b) else a


def greatest(a: f64, b: f64) -> f64:
    """The larger one; NaN, if one is."""
    return b if b > a or isnan(b) else a
'''


@dataclass(frozen=True)
class Monitor:
    """Name and files of the monitor, and from which field of the machine each of its inputs comes."""

    name: str
    config: str  # <name>.json
    sources: dict[str, str]  # by the name of the file, one for each requirement
    observed: tuple[tuple[str, str], ...]  # path in the machine, path in the monitor
    requirements: tuple[Requirement, ...]


def make_monitor(machine: Machine, requirements: list[Requirement]) -> Monitor:
    """`requirements`: at least one."""
    name = f"{machine.name}_requirements"
    writers = [_Algorithm(requirement, machine) for requirement in requirements]
    head = _HEAD.format(name=machine.name)
    sources = {f"{w.requirement.instance}.py": f"{head}\n\n{w.text()}" for w in writers}
    config = {
        "tick_hz": machine.tick_hz,
        "initial_state": "RUN",
        "algorithms": {w.class_name: {"source": f"{w.requirement.instance}.py"} for w in writers},
        "instances": {w.requirement.instance: {"algorithm": w.class_name} for w in writers},
        "states": {"RUN": {"schedule": {w.requirement.instance: machine.tick_hz for w in writers}}},
        "publish": [],
    }
    observed = tuple(pair for writer in writers for pair in writer.observed())
    return Monitor(name, json.dumps(config, indent=2) + "\n", sources, observed, tuple(requirements))


def subset_of(requirements: list[Requirement], machine: Machine) -> list[Requirement]:
    """Those that name only instances and channels which a subset machine has, and not its state: it stays in the first one,
    without what leads out of it."""
    signals = Signals(machine)
    names = {i.name for i in machine.instances}

    def has(requirement: Requirement) -> bool:
        if requirement.clock is not None and requirement.clock not in names:
            return False
        leaves = [node for root in requirement.expressions for node in root.walk() if node.operator == "field"]
        return all(signals.has(leaf.value) and leaf.value != "machine.state" for leaf in leaves)

    return [requirement for requirement in requirements if has(requirement)]


@dataclass
class _Algorithm:
    """Writes the algorithm of one requirement."""

    requirement: Requirement
    machine: Machine
    inputs: dict[str, tuple[str, str]] = field(default_factory=dict)  # name and type by path
    shown: list[str] = field(default_factory=list)  # inputs whose values a violation keeps

    def __post_init__(self) -> None:
        self.signals = Signals(self.machine)

    @property
    def class_name(self) -> str:
        return f"Monitor_{self.requirement.instance}"

    def observed(self) -> list[tuple[str, str]]:
        return [(path, f"{self.requirement.instance}.inputs.{name}") for path, (name, _) in self.inputs.items()]

    def _input(self, path: str, name: str, type_: str = "") -> str:
        """The value of a field of the machine: `self.value_3`."""
        if path not in self.inputs:
            self.inputs[path] = (name, type_ or _TYPES.get(self.signals.find(path).row.abi_type, "i32"))
        return f"self.{self.inputs[path][0]}"

    def _read(self, node: Node, element: int) -> str:
        path = str(node.value)
        if node.quantity.shape:
            path = f"{path[:-1]}, {element}]" if path.endswith("]") else f"{path}[{element}]"
        number = sum(name.startswith("value_") for name, _ in self.inputs.values())
        text = self._input(path, f"value_{number}")
        if text not in self.shown and text.startswith("self.value_"):
            self.shown.append(text)
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
        body = [*past.lines, *self._verdict(when, condition)]
        named = [] if r.hold else self._instances()
        guards = [f"{self._input(f'{name}.outputs.health', f'health_{n}')} == {_STALE}" for n, name in named]
        due = self._due()
        lines = [f"tick = {ticks} - 1"]
        lines += ["if self.last_tick != tick - 1:", "    self.started = False"]
        if r.clock is not None:
            faults = self._input(f"{r.clock}.counters.faults", "faults")
            lines += ["    if tick > 0:", f"        self.faults_before = {faults}"]
            lines += [f"completed = {faults} == self.faults_before", f"self.faults_before = {faults}"]
        lines.append("self.last_tick = tick")
        if guards:
            lines += [f"if {' or '.join(guards)}:", "    self.started = False"]
            lines += ["    self.asked = False"] if r.kind == "at_end" and r.clock is None else []
            lines += ["else:"]
            lines += [f"    {line}" for line in self._when_due(due, body)]
        else:
            lines += self._when_due(due, body)
        state = {"last_tick": "i64", "started": "bool", **past.state}
        if r.clock is not None:
            state["faults_before"] = "u64"
        if r.within_ticks:
            state["late_from"] = "i64"
        state["violated"] = "bool"
        return self._class(state, lines)

    def _instances(self) -> list[tuple[int, str]]:
        """The instances that the requirement names, which have no value while they are stale."""
        leaves = [node for root in self.requirement.expressions for node in root.walk() if node.operator == "field"]
        names = [self.signals.instance(leaf.value) for leaf in leaves]
        if self.requirement.clock is not None:
            names.append(self.requirement.clock)
        return list(enumerate(dict.fromkeys(name for name in names if name is not None)))

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

    def _verdict(self, when: Truth | None, condition: Truth) -> list[str]:
        r = self.requirement
        lines = [f"holds = {condition.true}", "self.evaluated += 1"]
        if when is None:
            lines += ["self.exercised += 1", "wrong = not holds"]
        else:
            lines += [f"when_true = {when.true}", f"when_false = {when.false}"]
            lines += ["if when_true:", "    self.exercised += 1"]
            lines += ["elif not when_false:", "    self.undefined += 1"]
            lines += ["wrong = when_true and not holds"]
        if r.kind == "at_end":
            return [*lines, f"self.asked = {'True' if when is None else 'when_true'}", "self.holds = not wrong"]
        if r.within_ticks:
            lines += ["if not wrong:", "    self.late_from = -1"]
            lines += ["elif self.late_from < 0 or restarted:", "    self.late_from = tick"]
            lines += [f"wrong = wrong and tick - self.late_from >= {r.within_ticks}"]
        keep = [f"self.{{}}_{name.removeprefix('self.')} = {name}" for name in self.shown]
        lines += ["if wrong:"]
        lines += ["    if self.violations == 0:", "        self.first_tick = tick"]
        lines += [f"        {line.format('first')}" for line in keep]
        lines += ["    if not self.violated or restarted:", "        self.violations += 1"]
        lines += ["    self.violated_ticks += 1", "    self.last_violated = tick"]
        lines += [f"    {line.format('last')}" for line in keep]
        lines += ["self.violated = wrong", "self.holds = not wrong"]
        return lines

    def _class(self, state: dict[str, str], lines: list[str]) -> str:
        r = self.requirement
        types = {name: type_ for name, type_ in self.inputs.values()}
        outputs = {"holds": "bool", **dict.fromkeys(("evaluated", "exercised", "undefined"), "u64")}
        if r.kind == "at_end":
            outputs["asked"] = "bool"
        else:
            outputs |= {"violations": "u64", "violated_ticks": "u64", "first_tick": "i64", "last_violated": "i64"}
            for name in self.shown:
                own = name.removeprefix("self.")
                outputs |= {f"first_{own}": types[own], f"last_{own}": types[own]}
        text = [f"class {self.class_name}:", f'    """{_comment(r.text)}"""', ""]
        for record, fields in (("inputs", types), ("outputs", outputs), ("state", state)):
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
