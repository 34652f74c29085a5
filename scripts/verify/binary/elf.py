# SPDX-License-Identifier: Apache-2.0
"""What a machine's library asks of the loader: symbols, relocations, constructors, data that can be written."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from fcsl_compiler.driver.symbols import ALLOWED, SymbolError, check_symbols

from ..shared.cases import CheckFailed, run

#: What the C compiler's start files (crti.o, crtbeginS.o) put into every shared library, whatever it is made of.
_CRT_WEAK = frozenset("_ITM_deregisterTMCloneTable _ITM_registerTMCloneTable __cxa_finalize __gmon_start__".split())
_CRT_WRITABLE = frozenset("__dso_handle __TMC_END__ completed.0".split())
_CRT_WRITABLE_BYTES = 8
_CRT_HOOKS = {".init_array": "frame_dummy", ".fini_array": "__do_global_dtors_aux"}
#: Addresses within the library, entries of its table of pointers, calls of imported functions.
_RELOCATIONS = frozenset("R_X86_64_RELATIVE R_X86_64_GLOB_DAT R_X86_64_JUMP_SLOT".split())
_LIBRARIES = frozenset({"libm.so.6", "libc.so.6"})
_NO_BITS = "NOBITS"
_ALLOCATED, _WRITABLE, _TLS = "A", "W", "T"


@dataclass(frozen=True)
class Section:
    """One section; addresses and sizes in bytes."""

    name: str
    kind: str
    address: int
    offset: int
    size: int
    flags: str


@dataclass(frozen=True)
class Symbol:
    """One symbol; section is "UND" where another library defines it."""

    name: str
    address: int
    size: int
    kind: str
    binding: str
    section: str


class Elf:
    """A shared library, read by readelf."""

    def __init__(self, path: Path):
        self.path = path

    @cached_property
    def sections(self) -> dict[str, Section]:
        row = re.compile(r"\[ *\d+\] (\.\S+) +(\S+) +(\w{16}) (\w+) (\w+) \w+ +([A-Zl]*) +\d")
        rows = (row.search(line) for line in run(["readelf", "-SW", self.path]).splitlines())
        return {
            m[1]: Section(m[1], m[2], int(m[3], 16), int(m[4], 16), int(m[5], 16), m[6]) for m in rows if m is not None
        }

    @cached_property
    def dynamic_symbols(self) -> list[Symbol]:
        return self._symbols("--dyn-syms")

    @cached_property
    def symbols(self) -> list[Symbol]:
        """All; of a library without that table, the dynamic ones."""
        return self._symbols("--symbols")

    def _symbols(self, table: str) -> list[Symbol]:
        """Rows are "number: value size type bind visibility section name[@version]"."""
        rows = [line.split() for line in run(["readelf", "-W", table, self.path]).splitlines()]
        numbers = {str(n): s for n, s in enumerate([""] + list(self.sections))}
        if table == "--symbols":  # readelf prints the dynamic table, too, and first
            last = max(i for i, r in enumerate(rows) if r[:2] == ["Symbol", "table"])
            rows = rows[last:]
        return [
            Symbol(r[7].split("@")[0], int(r[1], 16), int(r[2], 0), r[3], r[4], numbers.get(r[6], r[6]))
            for r in rows
            if len(r) > 7 and r[0].rstrip(":").isdigit()
        ]

    @cached_property
    def relocations(self) -> dict[int, tuple[str, str, int]]:
        """Address → (type, symbol or "", addend)."""
        found = {}
        for line in run(["readelf", "-rW", self.path]).splitlines():
            m = re.match(r"(\w{16})  \w{16} (R_\w+) +(?:\w{16} +(\S+) \+ )?(-?\w+)$", line.strip())
            if m:
                found[int(m[1], 16)] = (m[2], (m[3] or "").split("@")[0], int(m[4], 16))
        return found

    @cached_property
    def needed(self) -> list[str]:
        return re.findall(r"\(NEEDED\) +Shared library: \[(.*?)\]", run(["readelf", "-dW", self.path]))

    def bytes_at(self, address: int, size: int) -> bytes:
        """What lies in the file for these addresses. Raises CheckFailed when nothing does."""
        for s in self.sections.values():
            if s.address and s.address <= address and address + size <= s.address + s.size and s.kind != _NO_BITS:
                with self.path.open("rb") as file:
                    file.seek(s.offset + address - s.address)
                    return file.read(size)
        raise CheckFailed(f"{self.path.name}: no section holds {size} bytes at {address:#x}")

    def word_at(self, address: int) -> int:
        return int(struct.unpack("<i", self.bytes_at(address, 4))[0])

    def contents(self, section: str) -> bytes:
        s = self.sections[section]
        return self.bytes_at(s.address, s.size)

    @cached_property
    def _names(self) -> dict[int, list[str]]:
        found: dict[int, list[str]] = {}
        for s in self.symbols:
            if s.kind == "FUNC" and s.section != "UND":
                found.setdefault(s.address, []).append(s.name)
        return found

    def names_at(self, address: int) -> list[str]:
        """Functions that begin there."""
        return self._names.get(address, [])


def check_elf(elf: Elf) -> list[str]:
    """The functions that the library imports. Raises CheckFailed, which tells all that is wrong.

    Externs get no exemption here: they are linked in, as the target `simulation` has them.
    """
    checks: list[Callable[[Elf], list[str]]] = [_imports, _relocations, _hooks, _writable, _exports]
    wrong = [text for check in checks for text in check(elf)]
    try:
        imported = check_symbols(elf.path)
    except SymbolError as error:
        wrong.insert(0, str(error))
    if wrong:
        raise CheckFailed("; ".join(wrong))
    return sorted(set(imported) | {s.name for s in elf.dynamic_symbols if _is_import(s) and s.name in ALLOWED})


def _is_import(s: Symbol) -> bool:
    return s.section == "UND" and s.name != ""


def _imports(elf: Elf) -> list[str]:
    wrong = [f"imports weak {s.name}" for s in elf.dynamic_symbols if _is_import(s) and _strays(s)]
    wrong += [
        f"imports {s.name}, which is no function but {s.kind}"
        for s in elf.dynamic_symbols
        if _is_import(s) and s.binding != "WEAK" and s.kind != "FUNC"
    ]
    return wrong + [f"needs {name}" for name in elf.needed if name not in _LIBRARIES]


def _strays(s: Symbol) -> bool:
    return s.binding == "WEAK" and s.name not in _CRT_WEAK


def _relocations(elf: Elf) -> list[str]:
    kinds = {kind for kind, _, _ in elf.relocations.values()} - _RELOCATIONS
    wrong = [f"has relocations {', '.join(sorted(kinds))}"] if kinds else []
    return wrong + [f"resolves {s.name} when it is loaded" for s in elf.symbols if s.kind == "IFUNC"]


def _hooks(elf: Elf) -> list[str]:
    """Nothing runs when the library is loaded or unloaded but what the start files put there."""
    wrong = []
    for section, hook in _CRT_HOOKS.items():
        found = elf.sections.get(section)
        entries = range(found.address, found.address + found.size, 8) if found else ()
        for entry in entries:
            names = elf.names_at(elf.relocations[entry][2])
            if hook not in names:
                wrong.append(f"runs {' or '.join(names) or hex(entry)} from {section}")
    return wrong


def _writable(elf: Elf) -> list[str]:
    """No variable can be written once the loader is done: all constants with addresses are in .data.rel.ro."""
    wrong = [f"has thread-local {s.name}" for s in elf.sections.values() if _TLS in s.flags]
    for name in (".data", ".bss"):
        section = elf.sections.get(name)
        own = {s.name for s in elf.symbols if s.section == name and s.kind == "OBJECT"} - _CRT_WRITABLE
        if own:
            wrong.append(f"has variables in {name}: {', '.join(sorted(own))}")
        elif section is not None and section.size > _CRT_WRITABLE_BYTES:
            wrong.append(f"has {section.size} bytes in {name}, {_CRT_WRITABLE_BYTES} of them from the compiler")
    known = {
        ".data",
        ".bss",
        ".init_array",
        ".fini_array",
        ".data.rel.ro",
        ".dynamic",
        ".got",
        ".got.plt",
        ".tm_clone_table",
    }
    others = [s.name for s in elf.sections.values() if {_ALLOCATED, _WRITABLE} <= set(s.flags) and s.name not in known]
    return wrong + [f"has a writable section {name}" for name in others if not elf.sections[name].flags.count(_TLS)]


def _exports(elf: Elf) -> list[str]:
    """What is called within the library is bound within it: no other library of the process can take a function's place."""
    defined = {s.name for s in elf.dynamic_symbols if s.section != "UND"}
    bound = {name for kind, name, _ in elf.relocations.values() if name in defined}
    if not bound:
        return []
    return [f"calls its own {', '.join(sorted(bound))} through the loader, where another library may define them first"]
