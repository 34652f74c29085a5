# SPDX-License-Identifier: Apache-2.0
"""Whole machines against the same logic by hand in C: what their algorithms take, and what the machine adds to them."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.library import emit
from fcsl_compiler.emit.inline_size import takes_bodies_in
from fcsl_compiler.emit.tick import port_place
from fcsl_compiler.model.ir import Function
from fcsl_compiler.model.machine import Entry, Machine
from fcsl_compiler.model.types import Array
from fcsl_compiler.printers.c.expressions import CExpressions

from ...harness.native import BENCH, code_bytes, compile_program
from ...harness.size import sized

HERE = Path(__file__).resolve().parent
ROOT = BENCH.parents[1]
#: Where instructions are counted.
STEPPED = ROOT / "scripts/verify/instructions"
#: Intel's Skylake family decodes a jump anew each time when it touches the end of 32 bytes of code, which is a matter of chance.
PLACED = "-Wa,-mbranches-within-32B-boundaries"
ROUNDS = sized(20_001, 5)
#: The two must be the same controller, or their times mean nothing.
MAX_APART = 1e-9


@dataclass(frozen=True)
class Whole:
    """A machine to time in one of its states, and the same by hand: its C file, and what ties the two together."""

    config: Path
    state: str
    by_hand: str
    links: str


WHOLES = {
    "lander": Whole(
        ROOT / "examples/lander/fc/lander_control.json", "DESCENT", "peers/lander_by_hand.c", "subjects/whole/lander.c"
    ),
    "vehicle": Whole(
        BENCH / "machines/vehicle/vehicle.json", "MISSION", "peers/vehicle_by_hand.c", "subjects/whole/vehicle.c"
    ),
}


def _call(machine: Machine, entry: Entry, inputs: str) -> str:
    instance = machine.instances[entry.instance]
    function: Function = instance.execute
    arguments = [f"&{inputs if record == 'inputs' else 'm'}->i_{instance.name}.{record}" for record in function.records]
    return f"{function.name}({', '.join([*arguments, *(['&fault'] if function.faults else [])])});"


def _copies(machine: Machine, instance: int, delayed: bool) -> list[str]:
    """Statements that bring the inputs of an instance from where they are connected to; those from `machine` do not change."""
    found = []
    for c in machine.connections:
        if c.target.instance == instance and c.source.instance >= 0 and c.delayed == delayed:
            target, source = (CExpressions({}).text(port_place(machine, port)) for port in (c.target, c.source))
            is_array = isinstance(c.target.type, Array)
            found.append(f"memcpy({target}, {source}, sizeof {target});" if is_array else f"{target} = {source};")
    return found


def _bodies(machine: Machine, state: int, connected: bool) -> list[str]:
    entries = machine.states[state].entries
    lines = [
        # As the tick itself is made: its instances' bodies are taken into it.
        "__attribute__((flatten))" if takes_bodies_in(machine) else "",
        f"void whole_{'connected' if connected else 'bodies'}(void *machine, const void *past, uint64_t tick)",
        "{",
        f"    {machine.name}_t *const m = machine;",
        f"    const {machine.name}_t *const from = past;",
        "    int32_t fault = 0;",
        "    (void)tick, (void)from;",
    ]
    if connected:
        lines += [f"    {copy}" for entry in entries for copy in _copies(machine, entry.instance, True)]
    for (divisor, phase), due in groupby(entries, lambda e: (e.divisor, e.phase)):
        calls = []
        for entry in due:
            calls += [f"    {copy}" for copy in _copies(machine, entry.instance, False)] if connected else []
            calls.append(f"    {_call(machine, entry, 'm' if connected else 'from')}")
        lines += [f"    if (tick % {divisor}u == {phase}u) {{", *calls, "    }"] if divisor > 1 else calls
    return [*lines, "    (void)fault;", "}"]


def bodies_source(machine: Machine, state: str) -> str:
    """C that includes the machine's own, for its static functions, and calls those that are due in this state."""
    index = next(i for i, s in enumerate(machine.states) if s.name == state)
    lines = [
        f'#include "{machine.name}.c"',
        '#include "whole.h"',
        f"const fcsl_machine_t *const whole_machine = &{machine.name}_machine;",
        f"const int32_t whole_state = {index};",
        *_bodies(machine, index, False),
        *_bodies(machine, index, True),
    ]
    return "\n".join([*lines, ""])


def due_per_tick(machine: Machine, state: str) -> Fraction:
    """Instances that are due in a tick of this state, on average."""
    entries = next(s for s in machine.states if s.name == state).entries
    return sum((Fraction(1, e.divisor) for e in entries), Fraction(0))


def _times(folder: Path, whole: Whole, rounds: int, more: list[str]) -> dict[str, Any]:
    sources: list[str | Path] = [
        "subjects/whole/whole.c",
        "harness/timing.c",
        STEPPED / "stepped.c",
        whole.by_hand,
        whole.links,
    ]
    program = compile_program([*sources, folder / "bodies.c"], folder / "whole", [folder, HERE, STEPPED], more)
    done = subprocess.run([str(program), str(rounds)], stdout=subprocess.PIPE, text=True, check=True)
    facts: dict[str, Any] = json.loads(done.stdout)
    if not max(facts["apart"], facts["connected_apart"]) <= MAX_APART:
        raise RuntimeError(f"{whole.by_hand} is another controller than {whole.config.name} ({facts['apart']} apart)")
    return facts


def whole_times(folder: Path, whole: Whole, rounds: int = ROUNDS) -> dict[str, Any]:
    """Of step, bodies and the step by hand: ns and instructions per tick, what follows from them, bytes of code and state;
    `placed`: the same with every jump where no processor of this family is slow at it."""
    machine = emit([whole.config], folder)[0].checked
    (folder / "bodies.c").write_text(bodies_source(machine, whole.state))
    facts = _times(folder, whole, rounds, [])
    facts["placed"] = _times(folder, whole, rounds, [PLACED])
    due = float(due_per_tick(machine, whole.state))
    facts["due_per_tick"] = due
    for of in (facts, facts["placed"]):
        for name in ("besides_connected", "besides_bodies"):
            of[name] = {k: v / due for k, v in of.pop(f"{name}_ns").items()}
        of["besides_instructions"] = (of["step_instructions"] - of["connected_instructions"]) / due
    facts["code_bytes"] = code_bytes(folder / f"{machine.name}.c")
    facts["by_hand_code_bytes"] = code_bytes(BENCH / whole.by_hand)
    return facts


def _spread(figure: dict[str, float], unit: str = "") -> str:
    return f"{figure['median']:.2f}{unit} ({figure['low']:.2f} to {figure['high']:.2f})"


def _rows(f: dict[str, Any], due: float) -> list[tuple[str, str]]:
    def cost(name: str) -> str:
        return f"{f[f'{name}_ns']['median'] - f['sense_ns']['median']:.1f} ns, {f[f'{name}_instructions']:.0f} instr."

    return [
        ("    step", cost("step")),
        ("    by hand in C", cost("by_hand")),
        ("    bodies, connected", cost("connected")),
        ("    bodies apart", cost("bodies")),
        ("    step ÷ by hand (goal 1.0)", _spread(f["step_ratio"])),
        ("    bodies, connected ÷ by hand", _spread(f["connected_ratio"])),
        ("    bodies apart ÷ by hand", _spread(f["bodies_ratio"])),
        (f"    bookkeeping, each of {due:.2f} due (goal 1)", _spread(f["besides_connected"], " ns")),
        ("        instructions", f"{f['besides_instructions']:.1f}"),
        ("    step less bodies apart, each due", _spread(f["besides_bodies"], " ns")),
    ]


def whole_rows(facts: dict[str, dict[str, Any]]) -> list[tuple[str, str]]:
    rows = []
    for name, f in facts.items():
        rows += [(name, ""), *_rows(f, f["due_per_tick"])]
        rows += [(f"{name}, jumps placed", ""), *_rows(f["placed"], f["due_per_tick"])]
        rows += [
            (f"{name}: code, by hand", f"{f['code_bytes']} B, {f['by_hand_code_bytes']} B"),
            ("    state, by hand", f"{f['state_bytes']} B, {f['by_hand_state_bytes']} B"),
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        names = sys.argv[1:] or list(WHOLES)
        for row in whole_rows({n: whole_times(Path(name) / n, WHOLES[n]) for n in names}):
            print(f"{row[0]:<44}{row[1]:>50}")
