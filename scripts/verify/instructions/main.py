#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Instruction bounds of `fcsl build --report` against what is executed, in every state of every example and of generated
machines: no step takes more instructions than the bound, neither of the generated code alone nor with the math functions that
it calls; and the bound of the generated code of a small example is at most 2.5 times what its costliest step takes. Generated
machines have code behind conditions that never hold, which no compiler sees: theirs that are further off are named, and must be few. What the bound
itself gives away, over code that some step has reached, is little for these and for small examples.

Steps are counted exactly, one trap per instruction (stepped.h), under the stimulus of shared/stimulus.h. Calls of fcsl_math, libm
and libc enter the bound on their slowest ways, from a table that is checked here, too. What externs and the host's functions
execute is theirs and counts on neither side.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fcsl_compiler.build_report import bound as bound_module
from fcsl_compiler.build_report.instruction_table import most as price
from fcsl_compiler.build_report.machine_code import MachineCode
from fcsl_compiler.build_report.paths import Loop, Unbounded, callee
from fcsl_compiler.build_report.schedule_facts import slots
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import FLAGS, compile_objects, compiler
from fcsl_compiler.model.machine import Machine

from ..shared.cases import (
    EXAMPLES,
    ROOT,
    SHARED,
    SMALL_EXAMPLES,
    Case,
    CheckFailed,
    compile_c,
    emit_case,
    run,
    write_facts,
)
from .table import check_table

sys.path.insert(0, str(ROOT / "fcsl_compiler" / "test"))
from fcsl_generator.campaign import generate  # noqa: E402
from fcsl_generator.machines import cases as generated_cases  # noqa: E402

HERE = Path(__file__).resolve().parent
MOST_RATIO = 2.5
#: Of the states of generated machines.
MOST_FURTHER = 0.1
#: Over the code that some step has reached, for every machine but the larger examples: few of their ticks are counted,
#: and the longest path of a filter is rare.
MOST_REACHED_RATIO = 1.75
_START_FAULTED = 3
_OWN, _APART = 1, 2  # of stepped.h
#: (field, element, value): what the stimulus alone does not hit, written on every other tick.
SCENES = {"ahrs": [("imu.outputs.accel", 0, 0.3), ("imu.outputs.accel", 1, -0.2), ("imu.outputs.accel", 2, 9.8)]}

#: Loops within loops, without a branch that inputs decide: its bound is what it executes.
_CONTROL_ALGORITHM = '''class Summing:
    """A sum that every element of a matrix enters, row by row."""

    inputs = {"a": "f64[40][30]"}
    outputs = {"sum": "f64"}
    state = {"rows": "f64[40]"}

    def execute(self):
        total = 0.0
        for i in range(40):
            row = self.rows[i]
            for j in range(30):
                row = row * 0.5 + self.a[i, j]
            self.rows[i] = row
            total = total + row
        self.sum = total
'''
_CONTROL_CONFIG = """{"tick_hz": 100, "initial_state": "RUN",
 "algorithms": {"Summing": {"source": "summing.py"}}, "instances": {"one": {"algorithm": "Summing"}},
 "states": {"RUN": {"schedule": {"one": 100}}}, "transitions": []}
"""


@dataclass(frozen=True)
class StateFigures:
    """Of one state of one machine, the most instructions of a step as counted, and their bounds: of the generated code alone (the
    second without instructions that no tick of any state has reached), and of all."""

    machine: str
    state: str
    ticks: int
    own: int
    own_bound: int
    reached_bound: int
    all: int
    all_bound: int

    @property
    def ratio(self) -> float:
        return self.own_bound / self.own

    @property
    def reached_ratio(self) -> float:
        """Of the bound over the code that the stimulus has reached at all: what the bound itself gives away."""
        return self.reached_bound / self.own


@dataclass(frozen=True)
class Steps:
    """What was counted: (state, own, all) of every tick, and which instructions of the machine were executed at all."""

    ticks: list[tuple[int, ...]]
    reached: set[tuple[str, int]]


def measure(case: Case, ticks: int, seed: int, bounder: type[bound_module.Bounder]) -> list[StateFigures] | None:
    """One row for each state that had a tick; None when the machine's start faults. Raises CheckFailed, Unbounded."""
    machine = compile_machine(case.config, "", until="schedule").checked
    compiled = compile_objects([case.sources[0]], case.includes, case.folder / "objects")[0]
    code = MachineCode(machine, compiled, case.folder / "objects", case.includes)
    apart = code.whole.apart
    code.whole, code.own = bounder(code.code, apart, price), bounder(code.code, apart)
    bounds = [_state_bound(code, machine, n) for n in range(len(machine.states))]
    steps = _steps(case, code, compiled, ticks, seed)
    if steps is None:
        return None
    code.own = bounder(code.code, apart)  # anew: the other one keeps what it knows of callees
    code.own.reached = frozenset(steps.reached)
    over_reached = [_state_bound(code, machine, n)[0] for n in range(len(machine.states))]
    found = []
    for n, state in enumerate(machine.states):
        rows = [s for s in steps.ticks if s[0] == n]
        if rows:
            own, both = max(r[1] for r in rows), max(r[2] for r in rows)
            found.append(
                StateFigures(case.name, state.name, len(rows), own, bounds[n][0], over_reached[n], both, bounds[n][1])
            )
    return found


def _state_bound(code: MachineCode, machine: Machine, n: int) -> tuple[int, int]:
    state = machine.states[n]
    found = slots(state.entries)
    if found is None:
        raise CheckFailed(f"{machine.name}: state `{state.name}` has too long a cycle for this check")
    costs = [code.step(state, slot) for slot in found]
    return max(c.own for c in costs), max(c.whole for c in costs)


def _steps(case: Case, code: MachineCode, compiled: Path, ticks: int, seed: int) -> Steps | None:
    """None when the machine's start faults."""
    scene, kinds, program = (case.folder / name for name in ("scene", "kinds", "stepped_machine"))
    scene.write_text("".join(f"{path} {n} {v!r}\n" for path, n, v in SCENES.get(case.name, ())))
    flags = ["-std=gnu11", *FLAGS[1:], "-no-pie", "-Wl,-z,now"]
    sources = [compiled, *case.sources[1:], *case.externs]
    sources += [HERE / "stepped_machine.c", HERE / "stepped.c", SHARED / "stimulus.c"]
    compile_c(compiler(), flags, sources, [HERE, SHARED, *case.includes], program)
    starts = _starts(code, program)
    kinds.write_text("".join(f"{address} {size} {kind}\n" for address, size, kind in sorted(_kinds(code, starts))))
    line: list[str | Path] = [program, str(ticks), str(seed), kinds, scene]
    done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=900)
    if done.returncode == _START_FAULTED:
        return None
    if done.returncode != 0:
        raise CheckFailed(f"{case.name}: {program.name}: exit status {done.returncode}\n{done.stderr}")
    lines = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    addresses = {starts[section] + at: (section, at) for section, at in code.code.instructions}
    return Steps([row for row in lines if len(row) == 3], {addresses[row[0]] for row in lines if len(row) == 1})


def _starts(code: MachineCode, program: Path) -> dict[str, int]:
    """Where the sections of the machine's code came to lie."""
    found = [line.split() for line in run(["nm", program]).splitlines()]
    symbols = {words[2]: int(words[0], 16) for words in found if len(words) == 3}
    return {section: symbols[name] - at for name, (section, at) in code.code.functions.items() if name in symbols}


def _kinds(code: MachineCode, starts: dict[str, int]) -> Iterator[tuple[int, int, int]]:
    """Address, bytes and kind of every section of the machine's code, and then of calls that are somebody else's."""
    for section, start in starts.items():
        yield start, code.code.sections[section], _OWN
    for (section, at), i in code.code.instructions.items():
        target = callee(code.code, i) if i.mnemonic == "call" else None
        if isinstance(target, str) and (target == "" or target in code.whole.apart):
            yield starts[section] + at, i.length, _APART


class OneTurnShort(bound_module.Bounder):
    """The seeded defect: it forgets one turn of every loop (of which its first block is the least)."""

    def _loop(self, f: Any, loop: Loop, turn: Any, flow: Any) -> None:
        own: dict[Any, Any] = {}
        super()._loop(f, loop, turn, own)
        missing = len(f.blocks[loop.header].instructions)
        for target, (state, cost) in own.items():
            bound_module.merge(flow, target, state, cost - missing)


def judge(rows: list[StateFigures]) -> str:
    """What is wrong with these figures, or ""."""
    for r in rows:
        for taken, most, what in ((r.own, r.own_bound, "of its own"), (r.all, r.all_bound, "in all")):
            if taken > most:
                return f"{r.machine}, state {r.state}: a step took {taken} instructions {what}, the bound is {most}"
    return ""


def control(folder: Path, ticks: int, seed: int) -> StateFigures:
    """The check passes a machine that consists of loops, tightly, and finds a bound that misses one turn of each."""
    folder.mkdir()
    (folder / "summing.py").write_text(_CONTROL_ALGORITHM)
    (folder / "summing_control.json").write_text(_CONTROL_CONFIG)
    case = emit_case(folder / "summing_control.json", folder / "c")
    good = measure(case, ticks, seed, bound_module.Bounder) or []
    if not good or judge(good):
        raise CheckFailed(f"control: {judge(good) or 'no figures'}")
    if not judge(measure(case, ticks, seed, OneTurnShort) or []):
        raise CheckFailed("control: a bound that misses a turn of every loop passed")
    return good[0]


def check(ticks: int, generated: int, seed: int, points: int) -> int:
    began = time.monotonic()
    rows: list[StateFigures] = []
    unbounded: list[str] = []
    faulted = 0
    with tempfile.TemporaryDirectory(prefix="fcsl-instructions-") as scratch:
        folder = Path(scratch)
        tight = control(folder / "control", 8, seed)
        print(
            f"control: bound {tight.own_bound}, counted {tight.own}; one turn short of each loop is found", flush=True
        )
        table = check_table(folder, points)
        print(f"table: {table}", flush=True)
        counted = [(config, ticks if name in SMALL_EXAMPLES else ticks // 16) for name, config in EXAMPLES.items()]
        for n, machine in enumerate(generate(generated_cases(), generated, seed)):
            counted.append((machine.write(folder / f"in{n}", f"g{n}"), ticks // 2))
        for config, steps in counted:
            case = emit_case(config, folder / f"out_{config.stem}")
            try:
                found = measure(case, steps, seed, bound_module.Bounder)
            except Unbounded as error:
                unbounded.append(f"{case.name}: {error}")
                continue
            faulted += found is None
            rows += found or []
            if wrong := judge(found or []):
                raise CheckFailed(wrong)
            if case.name in EXAMPLES:
                for r in found or []:
                    print(_line(r), flush=True)
    return _conclude(rows, unbounded, faulted, table, tight, time.monotonic() - began)


def _line(r: StateFigures) -> str:
    math = f"; in all {r.all_bound} / {r.all}" if r.all_bound != r.own_bound else ""
    return f"{r.machine} {r.state}: bound {r.own_bound} / counted {r.own} = {r.ratio:.2f}, over reached code {r.reached_ratio:.2f}{math} ({r.ticks} ticks)"


def _conclude(
    rows: list[StateFigures],
    unbounded: list[str],
    faulted: int,
    table: dict[str, object],
    tight: StateFigures,
    spent: float,
) -> int:
    known = [r for r in rows if r.machine in SMALL_EXAMPLES or r.machine not in EXAMPLES]
    wide = [r for r in known if r.machine in SMALL_EXAMPLES and r.ratio > MOST_RATIO]
    generated = [r for r in known if r.machine not in SMALL_EXAMPLES]
    further = [r for r in generated if r.ratio > MOST_RATIO]
    loose = [r for r in known if r.reached_ratio > MOST_REACHED_RATIO]
    ratios = sorted(r.ratio for r in known)
    facts = {
        "states": len(rows),
        "machines": len({r.machine for r in rows}),
        "machines whose start faults": faulted,
        "without a bound": unbounded,
        "ratio, median": round(ratios[len(ratios) // 2], 3),
        "ratio, largest": round(ratios[-1], 3),
        "over reached code, largest": round(max(r.reached_ratio for r in known), 3),
        f"over reached code, above {MOST_REACHED_RATIO}": [_line(r) for r in loose],
        f"generated, above {MOST_RATIO}": [_line(r) for r in further],
        f"examples, above {MOST_RATIO}": [_line(r) for r in wide],
        "control": f"{tight.own_bound} / {tight.own}",
        "table": table,
        "seconds": round(spent, 1),
        "rows": [r.__dict__ | {"ratio": round(r.ratio, 3), "reached_ratio": round(r.reached_ratio, 3)} for r in rows],
    }
    write_facts("instructions", facts)
    for key in list(facts)[:-1]:
        print(f"  {key:36} {facts[key]}")
    return 1 if wide or loose or unbounded or len(further) > MOST_FURTHER * len(generated) else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument(
        "--ticks",
        type=int,
        default=256,
        help="per small example; half as many per generated machine, a sixteenth per larger example",
    )
    parser.add_argument("--generated", type=int, default=10, help="generated machines")
    parser.add_argument("--points", type=int, default=5, help="arguments per function of the table")
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    try:
        status = check(options.ticks, options.generated, options.seed, options.points)
    except CheckFailed as error:
        print(f"instructions: {error}", file=sys.stderr)
        return 1
    if status:
        print("instructions: a bound is missing, or further from what is executed than it should be", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
