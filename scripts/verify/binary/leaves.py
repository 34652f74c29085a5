# SPDX-License-Identifier: Apache-2.0
"""What the C library's functions need that a machine may call: bounded from their instructions, and measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.stack import LEAF_BYTES
from fcsl_compiler.driver.symbols import ALLOWED
from fcsl_compiler.driver.toolchain import compiler

from ..shared.cases import CheckFailed, run
from .calls import closure
from .code import Code
from .elf import Elf

HERE = Path(__file__).resolve().parent
#: Ends the process: how deep it goes is nobody's concern.
FATAL = frozenset({"__stack_chk_fail"})
#: glibc's wrappers report errors as of old through a `switch` that has no default: its instructions do not say where it ends.
_MEASURED_ALONE = frozenset("fmod fmodf sqrt sqrtf".split())


@dataclass(frozen=True)
class Leaf:
    """Bytes of stack, return address included; `bound` over all variants that the loader may choose, None without one."""

    name: str
    library: Path
    measured: int
    bound: int | None

    @property
    def bytes(self) -> int:
        return self.measured if self.bound is None else self.bound


def leaves(folder: Path, names: Sequence[str] = sorted(ALLOWED - FATAL)) -> dict[str, Leaf]:
    """Every function that a machine may call. Raises CheckFailed where one needs more than every build assumes."""
    program = folder / "leaves"
    sources = [HERE / "leaves.c", HERE / "painted.c"]
    run([*compiler(), "-std=c11", "-O2", *sources, "-o", program, "-Wl,--no-as-needed", "-lm", "-ldl"])
    libraries: dict[Path, Code] = {}
    found: dict[str, Leaf] = {}
    for name, measured, chosen, file in (line.split() for line in run([program, *names]).splitlines()):
        path = Path(file).resolve()
        code = libraries.setdefault(path, Code(Elf(path)))
        found[name] = Leaf(
            name, path, int(measured), None if name in _MEASURED_ALONE else _bound(code, name, int(chosen))
        )
    wrong = [
        f"{leaf.name} of {leaf.library}: measured {leaf.measured} bytes, bound {leaf.bound}, assumed {LEAF_BYTES}"
        for leaf in found.values()
        if leaf.bytes > LEAF_BYTES or leaf.measured > leaf.bytes
    ]
    if wrong or len(found) != len(names):
        raise CheckFailed("; ".join(wrong) or "a function of the C library was not measured")
    return found


def _bound(code: Code, name: str, chosen: int) -> int:
    """The deepest of a function's versions and variants. Raises CheckFailed: also when it calls another library.

    `chosen` is the address of the variant that this processor uses, which must be among those found.
    """

    def no_import(callee: str) -> int:
        if callee in FATAL:
            return 0
        raise CheckFailed(f"{code.elf.path.name}: {name} calls {callee}, of which this check knows nothing")

    entries = [(s.address, s.kind) for s in code.elf.dynamic_symbols if s.name == name and s.section != "UND"]
    bounds, known = [], []
    for address, kind in entries:
        found = closure(code, [address], no_import)
        if kind != "IFUNC":
            bounds.append(found.bounds[address])
            known.append(address)
            continue
        # What the loader calls chooses among functions, by the processor; all whose addresses it computes are candidates.
        variants = sorted({a for f in found.functions.values() for a in f.taken})
        bounds += closure(code, variants, no_import).bounds.values()
        known += variants
    if chosen not in known:
        raise CheckFailed(f"{code.elf.path.name}: {name} is at {chosen:#x}, which this check did not find")
    return max(bounds)
