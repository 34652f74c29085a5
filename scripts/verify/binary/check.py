# SPDX-License-Identifier: Apache-2.0
"""All that is looked at in one machine's library: on paper (symbols, calls, stack) and while it runs."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.toolchain import compiler, include_dirs

from ..shared.cases import SHARED, CheckFailed, run
from .build import Binary
from .elf import Elf, check_elf
from .graph import check_code, check_graph
from .leaves import FATAL, Leaf

HERE = Path(__file__).resolve().parent
SEED = 1
_TIMEOUT_S = 120
_CANNOT = 77


@dataclass(frozen=True)
class Tools:
    """What the checks of every library share."""

    runner: Path
    leaves: Mapping[str, Leaf]
    ticks: int

    def leaf_bytes(self, name: str) -> int:
        """Bytes of stack of an imported function. Raises CheckFailed for one that no machine may call."""
        if name in FATAL:
            return 0
        if name not in self.leaves:
            raise CheckFailed(f"a call of {name}")
        return self.leaves[name].bytes


@dataclass
class Result:
    """`findings`: check → what is wrong. `figures`: what was counted, as far as the checks got."""

    findings: dict[str, str] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)


def build_runner(folder: Path) -> Path:
    """The program that flies a library (run.c). Raises CheckFailed."""
    program = folder / "binary_run"
    sources = [*(HERE / f"{name}.c" for name in ("run", "painted", "counted")), SHARED / "stimulus.c"]
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", *(f"-I{d}" for d in (SHARED, *include_dirs()))]
    # -rdynamic: the libraries that it loads shall meet its allocator. -z now: the loader shall not run on the painted stack.
    run([*compiler(), *flags, "-rdynamic", "-Wl,-z,now", *sources, "-o", program, "-ldl", "-lm"])
    return program


def check(binary: Binary, tools: Tools) -> Result:
    """Every check, whatever the others find."""
    result = Result()
    on_paper: dict[str, Callable[[], Any]] = {
        "symbols": lambda: check_elf(Elf(binary.library)),
        "graph": lambda: check_graph(binary),
        "code": lambda: check_code(binary, tools.leaf_bytes),
    }
    for name, look in on_paper.items():
        try:
            result.figures[name] = look()
        except CheckFailed as error:
            result.findings[name] = str(error)
    try:
        seen = result.figures["seen"] = _fly(binary, tools, "free")
    except CheckFailed as error:
        result.findings["run"] = str(error)
    else:
        _judge(binary, seen, result)
    try:
        result.figures["strict"] = _fly(binary, tools, "strict")
    except CheckFailed as error:
        result.findings["strict"] = str(error)
    return result


def _judge(binary: Binary, seen: dict[str, int], result: Result) -> None:
    """What the run showed, against what it may."""
    found = result.findings
    if seen["start"]:
        found["start"] = f"start() of instance {seen['start'] - 1} faulted; nothing ran"
    if seen["visited"] != seen["states"]:
        found["states"] = f"{seen['visited']} of {seen['states']} states were visited"
    if seen["allocations"]:
        found["allocations"] = f"{seen['allocations']} calls of the allocator"
    if not seen["environment"]:
        found["environment"] = "rounding mode, traps or x87 registers are not as they were"
    if not seen["signals"]:
        found["signals"] = "the signal mask is not as it was"
    code = result.figures.get("code")
    bounds = {entry: [code and code.bounds[entry]] for entry in ("init", "start", "step")}
    bounds["step"].append(binary.bound)
    for entry, numbers in bounds.items():
        measured = seen[f"{entry}_bytes"]
        if any(bound is not None and measured > bound for bound in numbers):
            found["stack"] = f"{entry} used {measured} bytes of stack, more than {numbers} (code, graphs)"
    if binary.bound and code and not binary.externs and code.bounds["step"] > binary.bound:
        found["stack"] = (
            f"the code needs {code.bounds['step']} bytes of stack, more than the {binary.bound} that are told"
        )


def _fly(binary: Binary, tools: Tools, mode: str) -> dict[str, int]:
    """What the runner prints. Raises CheckFailed when it dies, also where the kernel has no strict mode."""
    line = [tools.runner, binary.library, binary.machine, str(tools.ticks), str(SEED), mode]
    done = subprocess.run(list(map(str, line)), capture_output=True, text=True, check=False, timeout=_TIMEOUT_S)
    if done.returncode == _CANNOT:
        raise CheckFailed("this kernel does not offer the strict seccomp mode, so that system calls cannot be excluded")
    if done.returncode < 0:
        raise CheckFailed(f"killed by signal {-done.returncode}")
    if done.returncode:
        raise CheckFailed(done.stderr.strip() or f"exit status {done.returncode}")
    return {name: int(value) for name, value in (row.split() for row in done.stdout.splitlines())}


def figures(binary: Binary, result: Result) -> dict[str, Any]:
    """A row of the table."""
    graph, code, seen = (result.figures[k] for k in ("graph", "code", "seen"))
    bound = binary.bound or 0
    return {
        "machine": binary.machine,
        "imports": len(result.figures["symbols"]),
        "functions": code.functions,
        "functions_in_graph": graph.functions,
        "chain": code.chain,
        "host_calls": len(code.host),
        "host_table": sorted(set(code.host)),
        "bound_bytes": bound,
        "bound_from_code_bytes": code.bounds["step"],
        "measured_bytes": seen["step_bytes"],
        "bound_to_measured": round(bound / seen["step_bytes"], 2),
        "states": seen["visited"],
        "strict_ticks": result.figures["strict"]["ticks"],
        "allocations": seen["allocations"],
    }
