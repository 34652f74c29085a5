# SPDX-License-Identifier: Apache-2.0
"""The monitor of a machine: a machine of its own with an instance for each requirement, in the language itself.

Its inputs are fields of the machine that it watches, which a host copies after each tick. It changes nothing of it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from ..model.machine import Machine
from .algorithm import AlgorithmWriter, file_head
from .code import Truth
from .read import Signals
from .requirement import Requirement


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
    writers = [_Reporting(requirement, machine) for requirement in requirements]
    head = file_head("A requirement", machine.name)
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


class _Reporting(AlgorithmWriter):
    """Counts evaluations and violations, and keeps the values of the first and the last one."""

    def observed(self) -> list[tuple[str, str]]:
        return [(path, f"{self.requirement.instance}.inputs.{name}") for path, (name, _) in self.inputs.items()]

    def outputs(self) -> Mapping[str, str]:
        types = dict(self.inputs.values())
        outputs = {"holds": "bool", **dict.fromkeys(("evaluated", "exercised", "undefined"), "u64")}
        if self.requirement.kind == "at_end":
            return {**outputs, "asked": "bool"}
        outputs |= {"violations": "u64", "violated_ticks": "u64", "first_tick": "i64", "last_violated": "i64"}
        for name in self.values:
            own = name.removeprefix("self.")
            outputs |= {f"first_{own}": types[own], f"last_{own}": types[own]}
        return outputs

    def state(self) -> Mapping[str, str]:
        return {"violated": "bool"}

    def interrupted(self) -> list[str]:
        asked = ["self.asked = False"] if self.requirement.kind == "at_end" and self.requirement.clock is None else []
        return [*super().interrupted(), *asked]

    def verdict(self, when: Truth | None, wrong: list[str]) -> list[str]:
        lines = [*wrong, _count("evaluated")]
        if when is None:
            lines += [_count("exercised")]
        else:
            lines += [f"when_false = {when.false}", "if when_true:", f"    {_count('exercised')}"]
            lines += ["elif not when_false:", f"    {_count('undefined')}"]
        if self.requirement.kind == "at_end":
            return [*lines, f"self.asked = {'True' if when is None else 'when_true'}", "self.holds = not wrong"]
        keep = [f"self.{{}}_{name.removeprefix('self.')} = {name}" for name in self.values]
        lines += ["if wrong:"]
        lines += ["    if self.violations == 0:", "        self.first_tick = tick"]
        lines += [f"        {line.format('first')}" for line in keep]
        lines += ["    if not self.violated or restarted:", f"        {_count('violations')}"]
        lines += [f"    {_count('violated_ticks')}", "    self.last_violated = tick"]
        lines += [f"    {line.format('last')}" for line in keep]
        lines += ["self.violated = wrong", "self.holds = not wrong"]
        return lines


def _count(name: str) -> str:
    return f"self.{name} = wrap_add(self.{name}, 1)"
