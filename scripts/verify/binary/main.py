# SPDX-License-Identifier: Apache-2.0
"""No allocation, bounded stack, no foreign call: looked at in the library of every example and of generated machines.

python3 scripts/verify binary [--ticks N] [--generated N] [--seed N]

Seeded defects (controls.py) show that each check can fail. Reads x86-64 machine code, and needs glibc and gcc.
"""

from __future__ import annotations

import argparse
import json
import platform
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.packages import PackageNotFound, package_prefix
from fcsl_compiler.driver.stack import LEAF_BYTES
from fcsl_compiler.driver.toolchain import ToolchainError

from ..shared.cases import EXAMPLES, NUMBERS, ROOT, CheckFailed, write_facts
from ..shared.cases import generated as generated_machines
from .build import Binary, build
from .check import Result, Tools, build_runner, check, figures
from .controls import CONTROLS, base, seed
from .controls import TICKS as CONTROL_TICKS
from .elf import Elf, check_elf
from .leaves import Leaf, leaves


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=10_000, help="of each machine, in each way of running it")
    parser.add_argument("--generated", type=int, default=4, help="machines from the generator of the compiler's tests")
    parser.add_argument("--seed", type=int, default=1, help="of that generator")
    options = parser.parse_args()
    if platform.machine() != "x86_64":
        print(f"binary: reads the machine code of x86-64 alone; this is {platform.machine()}", file=sys.stderr)
        return 1
    try:
        with tempfile.TemporaryDirectory(prefix="fcsl-binary-") as scratch:
            _check_all(Path(scratch), options.ticks, options.generated, options.seed)
    except (CheckFailed, DiagnosticError, PackageNotFound, ToolchainError) as error:
        print(f"binary: {error}", file=sys.stderr)
        return 1
    return 0


def _check_all(folder: Path, ticks: int, generated: int, seed_number: int) -> None:
    print("functions of the C library that a machine may call", flush=True)
    found = leaves(folder)
    tools = Tools(build_runner(folder), found, ticks)
    rows: list[dict[str, Any]] = []
    built: dict[str, Binary] = {}
    for label, config, backend in _machines(folder, generated, seed_number):
        print(f"{label}: {ticks} ticks", flush=True)
        binary = built[label] = build(config, folder / label.replace(" ", "_"), backend)
        rows.append({**figures(binary, _right(label, check(binary, tools))), "machine": label})
    installed = _check_installed()
    controls = _controls(folder / "controls", replace(tools, ticks=CONTROL_TICKS))
    controls.append(_too_few_ticks(built["lander_control"], replace(tools, ticks=1)))
    _print(rows, found, controls)
    write_facts("binary", {"machines": rows, "installed": installed, "leaves": _leaf_rows(found), "controls": controls})


def _machines(folder: Path, generated: int, seed_number: int) -> Iterator[tuple[str, Path, str]]:
    """Label, machine JSON, backend."""
    named = {**EXAMPLES, NUMBERS.stem: NUMBERS, "lander_control, timed": _timed(folder / "timed")}
    for label, config in named.items():
        yield label, config, "c"
        yield f"{label}, Nim", config, "nim"
    for label, config in generated_machines(folder, generated, seed_number):
        yield label, config, "c"


def _timed(folder: Path) -> Path:
    """The lander with every instance timed, so that its step asks the host for the time."""
    shutil.copytree(EXAMPLES["lander_control"].parent, folder)
    config = folder / "lander_control.json"
    machine = json.loads(config.read_text(encoding="utf-8"))
    for instance in machine["instances"].values():
        instance["max_wcet_us"] = 1000
    config.write_text(json.dumps(machine), encoding="utf-8")
    return config


def _check_installed() -> int:
    """Libraries that fcsl_add_machine made of the examples: linked by CMake, and by the same rules. Raises CheckFailed."""
    packages = [config.relative_to(ROOT / "examples").parts[0] for config in EXAMPLES.values()]
    libraries = [f for p in packages for f in (package_prefix(p) / "lib" / p).glob("lib*_machines.so")]
    for library in libraries:
        try:
            check_elf(Elf(library))
        except CheckFailed as error:
            raise CheckFailed(f"{library}: {error}") from None
    if len(libraries) != len(packages):
        raise CheckFailed(f"{len(libraries)} libraries of {len(packages)} examples are installed; run `make build`")
    return len(libraries)


def _right(label: str, result: Result) -> Result:
    """Raises CheckFailed for any finding."""
    if result.findings:
        raise CheckFailed("\n".join(f"{label}: {name}: {text}" for name, text in result.findings.items()))
    return result


def _controls(folder: Path, tools: Tools) -> list[dict[str, Any]]:
    """What found each seeded defect. Raises CheckFailed when a check that must find it does not, or finds what is none."""
    clean = folder / "clean"
    made = base(clean)
    rows = []
    for n, control in enumerate(CONTROLS):
        print(f"control {n + 1} of {len(CONTROLS)}: {control.name}", flush=True)
        found = check(seed(control, made, clean, folder / str(n)), tools).findings
        missing = [name for name, words in control.found_by.items() if words not in found.get(name, "")]
        if missing:
            raise CheckFailed(f"control `{control.name}` was not found by {', '.join(missing)}; found: {found}")
        if found and not control.found_by:
            raise CheckFailed(f"control `{control.name}` is no defect; found: {found}")
        rows.append({"control": control.name, "found_by": sorted(found)})
    return rows


def _too_few_ticks(lander: Binary, tools: Tools) -> dict[str, Any]:
    """The control of what else a run must be: in every state. Raises CheckFailed."""
    found = check(lander, tools).findings
    if "1 of 4 states" not in found.get("states", ""):
        raise CheckFailed(f"one tick of the lander is in one state, and that was not found; found: {found}")
    return {"control": "one tick of a machine of four states", "found_by": sorted(found)}


def _leaf_rows(found: dict[str, Leaf]) -> list[dict[str, Any]]:
    return [{"function": f.name, "measured_bytes": f.measured, "bound_bytes": f.bound} for f in found.values()]


def _print(rows: list[dict[str, Any]], found: dict[str, Leaf], controls: list[dict[str, Any]]) -> None:
    columns = {
        "machine": "machine",
        "imports": "imports",
        "functions": "functions",
        "chain": "longest chain",
        "host_calls": "host calls",
        "bound_bytes": "stack bound",
        "bound_from_code_bytes": "by code",
        "measured_bytes": "measured",
        "bound_to_measured": "ratio",
        "states": "states",
        "strict_ticks": "ticks in strict mode",
        "allocations": "allocations",
    }
    _table([list(columns.values()), *([str(row[key]) for key in columns] for row in rows)])
    for row in rows:
        if row["host_calls"]:
            print(f"{row['machine']} calls the host's {', '.join(row['host_table'])}")
    _table(
        [
            ["control", "found by"],
            *([c["control"], ", ".join(c["found_by"]) or "none, as it must be"] for c in controls),
        ]
    )
    deepest = max(found.values(), key=lambda f: f.bytes)
    unbounded = [f"{f.name} {f.measured}" for f in found.values() if f.bound is None]
    print(
        f"\nC library: {len(found)} functions; the deepest is {deepest.name}, {deepest.bytes} bytes ({LEAF_BYTES} assumed)"
    )
    print(f"measured, not bounded: {', '.join(unbounded)} bytes")


def _table(rows: list[list[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    print()
    for row in rows:
        print("  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]))


if __name__ == "__main__":
    sys.exit(main())
