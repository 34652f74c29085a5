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

from native import HERE, code_bytes, compile_program

from fcsl_compiler.build import emit
from fcsl_compiler.ir import Function
from fcsl_compiler.machine import Entry, Machine

ROOT = HERE.parents[1]
ROUNDS = 201
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
    "lander": Whole(ROOT / "examples/lander/fc/lander_control.json", "DESCENT", "lander_by_hand.c", "whole_lander.c"),
    "vehicle": Whole(HERE / "vehicle/vehicle.json", "MISSION", "vehicle/vehicle_by_hand.c", "whole_vehicle.c"),
}


def _call(machine: Machine, entry: Entry) -> str:
    instance = machine.instances[entry.instance]
    function: Function = instance.execute
    arguments = [
        f"&{'from' if record == 'inputs' else 'm'}->i_{instance.name}.{record}" for _, record in function.records
    ]
    return f"{function.name}({', '.join([*arguments, *(['&fault'] if function.faults else [])])});"


def bodies_source(machine: Machine, state: str) -> str:
    """C that includes the machine's own, for its static functions, and calls those that are due in this state."""
    index = next(i for i, s in enumerate(machine.states) if s.name == state)
    lines = [
        f'#include "{machine.name}.c"',
        '#include "whole.h"',
        f"const fcsl_machine_t *const whole_machine = &{machine.name}_machine;",
        f"const int32_t whole_state = {index};",
        "void whole_bodies(void *machine, const void *past, uint64_t tick)",
        "{",
        f"    {machine.name}_t *const m = machine;",
        f"    const {machine.name}_t *const from = past;",
        "    int32_t fault = 0;",
        "    (void)tick;",
    ]
    for (divisor, phase), entries in groupby(machine.states[index].entries, lambda e: (e.divisor, e.phase)):
        calls = [f"    {_call(machine, entry)}" for entry in entries]
        lines += [f"    if (tick % {divisor}u == {phase}u) {{", *calls, "    }"] if divisor > 1 else calls
    return "\n".join([*lines, "    (void)fault;", "}", ""])


def due_per_tick(machine: Machine, state: str) -> Fraction:
    """Instances that are due in a tick of this state, on average."""
    entries = next(s for s in machine.states if s.name == state).entries
    return sum((Fraction(1, e.divisor) for e in entries), Fraction(0))


def whole_times(folder: Path, whole: Whole, rounds: int = ROUNDS) -> dict[str, Any]:
    """ns per tick of step, bodies and the step by hand; bytes of code and state of both."""
    machine = emit([whole.config], folder)[0].checked
    (folder / "bodies.c").write_text(bodies_source(machine, whole.state))
    sources: list[str | Path] = ["whole.c", "timing.c", whole.by_hand, whole.links, folder / "bodies.c"]
    program = compile_program(sources, folder / "whole", [folder])
    done = subprocess.run([str(program), str(rounds)], stdout=subprocess.PIPE, text=True, check=True)
    facts: dict[str, Any] = json.loads(done.stdout)
    if not facts["apart"] <= MAX_APART:
        raise RuntimeError(f"{whole.by_hand} is another controller than {whole.config.name} ({facts['apart']} apart)")
    due = float(due_per_tick(machine, whole.state))
    facts["due_per_tick"] = due
    facts["bodies_ratio"] = (facts["bodies_ns"] - facts["sense_ns"]) / (facts["by_hand_ns"] - facts["sense_ns"])
    facts["bookkeeping_ns"] = (facts["step_ns"] - facts["bodies_ns"]) / due
    facts["over_by_hand_ns"] = (facts["step_ns"] - facts["by_hand_ns"]) / due
    facts["code_bytes"] = code_bytes(folder / f"{machine.name}.c")
    facts["by_hand_code_bytes"] = code_bytes(HERE / whole.by_hand)
    return facts


def whole_rows(facts: dict[str, dict[str, Any]]) -> list[tuple[str, str]]:
    rows = []
    for name, f in facts.items():
        sense = f["sense_ns"]
        rows += [
            (f"{name}: step, compiled by fcslc", f"{f['step_ns'] - sense:.1f} ns"),
            ("    by hand in C", f"{f['by_hand_ns'] - sense:.1f} ns"),
            (
                "    algorithm bodies alone",
                f"{f['bodies_ns'] - sense:.1f} ns, {f['bodies_ratio']:.2f} × by hand (goal 1.05)",
            ),
            ("    bookkeeping per due instance", f"{f['bookkeeping_ns']:.2f} ns × {f['due_per_tick']:.2f} (goal 3)"),
            ("    step less by hand, per due instance", f"{f['over_by_hand_ns']:.2f} ns"),
            ("    code, by hand", f"{f['code_bytes']} B, {f['by_hand_code_bytes']} B"),
            ("    state, by hand", f"{f['state_bytes']} B, {f['by_hand_state_bytes']} B"),
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        names = sys.argv[1:] or list(WHOLES)
        for row in whole_rows({n: whole_times(Path(name) / n, WHOLES[n]) for n in names}):
            print(f"{row[0]:<44}{row[1]:>50}")
