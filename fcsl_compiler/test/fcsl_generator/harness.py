# SPDX-License-Identifier: Apache-2.0
"""Runs a case in every implementation and compares all fields bit for bit after every tick."""

from __future__ import annotations

import math
import struct
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fcsl_test_abi import HEALTH, TYPES, Machine
from fcsl_test_twins import InReference

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.library import build_library
from fcsl_compiler.driver.passes import Compilation
from fcsl_compiler.driver.toolchain import ToolchainError
from fcsl_compiler.reference.externs import externs_of

from .externs import Calls, CCalls
from .hardware import Board
from .machines import Action, Case
from .ticks import Fields, OracleMachine

#: Fields after init and after every tick. A failed start ends the trace with its instance.
Trace = list[Fields]


def run(m: Machine, case: Case) -> Trace:
    """Initialises a machine in memory and runs the case."""
    if m.init_result:
        name = list(m.instances)[m.init_result - 1]
        return [{"init": [name, m.fault(name)]}]
    externs = case.program.externs
    board = Board(case.board, CCalls(m.dll, m.d.name.decode(), externs) if externs else Calls())
    if case.board:
        m.use_hardware(board.functions())
    trace = [_fields(m, board)]
    for actions in case.ticks:
        for action in actions:
            _act(m, action)
        m.step()
        trace.append(_fields(m, board))
    return trace


def _fields(m: Machine, board: Board) -> Fields:
    requests = _requests(m)
    found: Fields = {"hardware": list(board.calls), "externs": board.externs.text()}
    lost, told = m.told()
    found["events"] = [lost, *(part for name, _, text, values in told for part in (f"{name} {text}", *values))]
    for path, field in m.fields.items():
        names = {"request": requests, "health": HEALTH, "state": m.states}.get(TYPES[field.type])
        found[path] = [names[v] if names else v for v in m.raw(path)]
    return found | {f"{name}.counters.fault_place": [m.fault(name)] for name in m.instances}


def _requests(m: Machine) -> list[str]:
    return ["", *(m.d.requests[i].decode() for i in range(m.d.request_count))]


def _inject(m: Machine, instance: str, what: int) -> None:
    """As hosts do: the worst counts, and a fault (1) is worse than a health (2, 3)."""
    injected = m.byte(m.instances[instance].inject_fault_offset)
    if injected[0] != 1 and (what == 1 or what > injected[0]):
        injected[0] = what


def _act(m: Machine, action: Action) -> None:
    if action.kind == "set":
        words = _requests(m) if TYPES[m.fields[action.target].type] == "request" else HEALTH
        m.set(action.target, [words.index(v) if isinstance(v, str) else v for v in flat(action.value)])
    elif action.kind == "overrun":
        m.byte(m.instances[action.target].inject_overrun_offset)[0] = 1
    elif action.kind == "fault":
        _inject(m, action.target, 1)
    elif action.kind == "health":
        _inject(m, action.target, 1 + HEALTH.index(action.value))
    elif action.kind == "force":
        m.force_state(action.target)
    elif action.kind == "attach":
        m.byte(m.channels[action.target].attached)[0] = 1
    else:
        m.sample(action.target, *action.value)


def flat(value: Any) -> list[Any]:
    return [x for v in value for x in flat(v)] if isinstance(value, list) else [value]


def by_oracle(case: Case) -> Trace:
    m = OracleMachine(case)
    if m.failed_start:
        return [{"init": m.failed_start}]
    trace = [m.fields()]
    for actions in case.ticks:
        for action in actions:
            m.act(action)
        m.step()
        trace.append(m.fields())
    return trace


def canonical(value: Any) -> Any:
    """Representation for comparison: all NaNs are equal, zeros keep their signs."""
    if isinstance(value, float):  # also np.float64
        return "nan" if math.isnan(value) else struct.pack("<d", value).hex()
    return canonical(float(value)) if type(value).__name__ == "float32" else value


def difference(found: Trace, expected: Trace, who: str) -> str:
    """Describes the first field that differs; "" if none does."""
    for tick, (one, other) in enumerate(zip(found, expected, strict=False), -1):
        where = "after init" if tick < 0 else f"after tick {tick}"
        for path in [*other, *(p for p in one if p not in other)]:
            left, right = one.get(path), other.get(path)
            if left is None or right is None or list(map(canonical, left)) != list(map(canonical, right)):
                return f"{where}: {path}: native {left}, {who} {right}"
    return "" if len(found) == len(expected) else f"native ran {len(found) - 1} ticks, {who} {len(expected) - 1}"


def causes(trace: Trace) -> Trace:
    """The trace with the causes of faults instead of their places, because an oracle has no source lines."""

    def cause(value: Any) -> Any:
        return value[-1] if isinstance(value, tuple) else "" if value is None else value

    return [{path: list(map(cause, values)) for path, values in fields.items()} for fields in trace]


def _without_memory(trace: Trace) -> Trace:
    """The trace without what requirements read and remember, which their oracle has as whole histories."""

    def is_shown(path: str) -> bool:
        return not path.startswith("requirements.") or path.endswith(".outputs.health")

    return [{path: values for path, values in fields.items() if is_shown(path)} for fields in trace]


def check(cases: Sequence[Case], backend: str = "c") -> list[str]:
    """A description of the failure for each case, "" if it passes. All cases are compiled into one library."""
    with tempfile.TemporaryDirectory(prefix="fcsl-generated-") as scratch:
        folder = Path(scratch)
        configs = [case.write(folder / f"g{n}", f"g{n}") for n, case in enumerate(cases)]
        library = folder / "out" / "libgenerated.so"
        try:
            compiled = build_library(configs, library, backend=backend)
        except (DiagnosticError, ToolchainError) as error:
            if len(cases) == 1:
                return [f"not compiled:\n{error}"]
            return [check([case], backend)[0] for case in cases]
        return [_check(library, one, case) for one, case in zip(compiled, cases, strict=True)]


def _check(library: Path, compiled: Compilation, case: Case) -> str:
    found = run(Machine(library, compiled.checked.name), case)
    return difference(_without_memory(causes(found)), by_oracle(case), "oracle") or difference(
        found, by_reference(library, compiled, case), "CPython"
    )


def by_reference(library: Path, compiled: Compilation, case: Case) -> Trace:
    try:
        return run(in_reference(library, compiled, case), case)
    except Exception as error:  # a crash of an implementation is a failure like any other
        return [{"raised": [f"{type(error).__name__}: {error}"]}]


def in_reference(library: Path, compiled: Compilation, case: Case) -> InReference:
    """Runs the machine in CPython. It calls the same C functions."""
    externs = externs_of(library) if case.program.externs else None
    return InReference(library, compiled.checked, externs=externs)
