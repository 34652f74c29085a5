# SPDX-License-Identifier: Apache-2.0
"""Reads a compiled machine with objdump: instructions, jump targets, calls, sizes."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

#: Address of an instruction: section and offset.
Address = tuple[str, int]

_SECTION = re.compile(r"^Disassembly of section (\S+):")
_LABEL = re.compile(r"^([0-9a-f]+) <(.+)>:$")
_LINE = re.compile(r"^\s*([0-9a-f]+):\t([^#]*?)\s*(?:#.*?)?(?:\t([0-9a-f]+): (R_\S+)\s+(\S+))?$")
_VALUE = re.compile(r"^(.+?)([+-]0x[0-9a-f]+)?$")
_PREFIX = re.compile(r"^(?:(?:notrack|bnd|data16|cs|lock|addr32|repz(?= ret))\s+)+")
_RECORDS = re.compile(r"^RELOCATION RECORDS FOR \[(\S+)\]:")
_RECORD = re.compile(r"^([0-9a-f]+) (R_\S+)\s+(\S+)$")
_SIZE = re.compile(r"^\s*\d+ (\S+)\s+([0-9a-f]{8,}) ")


class NotReadable(Exception):
    """The machine code of this build cannot be analysed. str() gives the reason for users."""


@dataclass(frozen=True)
class Instruction:
    address: Address
    length: int
    mnemonic: str
    operands: tuple[str, ...]  # in AT&T notation: the target is last
    symbol: str  # symbol of its relocation, "" without one
    addend: int  # addend of the relocation as the linker uses it


@dataclass
class ObjectFile:
    instructions: dict[Address, Instruction] = field(default_factory=dict)
    functions: dict[str, Address] = field(default_factory=dict)
    tables: dict[Address, Address] = field(default_factory=dict)  # words of jump tables that hold code addresses
    sections: dict[str, int] = field(default_factory=dict)  # size in bytes by name
    table_starts: set[Address] | None = None  # starts of jump tables, computed on first use

    def function_of(self, address: Address) -> str:
        """Name of the function that contains an address."""
        starts = {
            at: name for name, (section, at) in self.functions.items() if section == address[0] and at <= address[1]
        }
        return starts[max(starts)] if starts else ""

    def address_of(self, i: Instruction) -> Address | None:
        """Address that a 32-bit relative relocation refers to, if it is in this object."""
        offset = i.addend + 4
        if i.symbol in self.functions:
            section, start = self.functions[i.symbol]
            return section, start + offset
        return (i.symbol, offset) if i.symbol in self.sections else None


def _objdump(*arguments: str | Path) -> str:
    command = shlex.split(os.environ.get("OBJDUMP", "")) or ["objdump"]
    try:
        done = subprocess.run([*command, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        raise NotReadable(f"`{command[0]}` does not run; install binutils, or set OBJDUMP") from None
    if done.returncode != 0:
        raise NotReadable(f"`{command[0]}` cannot read the object file: {done.stderr.strip()}")
    return done.stdout


def read_object(path: Path) -> ObjectFile:
    """Reads the code of one object file. Raises NotReadable without objdump, or if the code is not x86-64."""
    found = ObjectFile()
    text = _objdump("-h", "-w", path)
    if "elf64-x86-64" not in text:
        raise NotReadable("instruction bounds are available only for x86-64 (ELF)")
    for line in text.splitlines():
        if size := _SIZE.match(line):
            found.sections[size[1]] = int(size[2], 16)
    _read_code(found, _objdump("-d", "-r", "-w", "-z", "--no-show-raw-insn", path))
    _read_tables(found, _objdump("-r", "-w", path))
    return found


def read_words(path: Path, symbol_section: str) -> list[int]:
    """A section as 64-bit little-endian words."""
    data = bytearray()
    for line in _objdump("-s", "-j", symbol_section, path).splitlines():
        if line.startswith(" "):
            data += bytes.fromhex(line[1:].split("  ")[0].split(" ", 1)[1].replace(" ", ""))
    return [int.from_bytes(data[n : n + 8], "little") for n in range(0, len(data), 8)]


def _read_code(found: ObjectFile, text: str) -> None:
    section, lines = "", []
    for line in text.splitlines():
        if name := _SECTION.match(line):
            section = name[1]
        elif label := _LABEL.match(line):
            found.functions[label[2]] = (section, int(label[1], 16))
        elif code := _LINE.match(line):
            lines.append((section, int(code[1], 16), code[2], code[5] or ""))
    for (section, start, words, value), following in zip(lines, [*lines[1:], ("", 0, "", "")], strict=True):
        end = following[1] if following[0] == section else found.sections[section]
        symbol, addend = _relocation(value)
        mnemonic, _, operands = _PREFIX.sub("", words).partition(" ")
        if mnemonic in ("rep", "repz", "repnz"):
            mnemonic, _, operands = operands.strip().partition(" ")
            mnemonic = f"rep {mnemonic}"
        at = (section, start)
        found.instructions[at] = Instruction(at, end - start, mnemonic, _operands(operands), symbol, addend)


def _relocation(value: str) -> tuple[str, int]:
    parts = _VALUE.match(value)
    return (parts[1], int(parts[2] or "0", 16)) if parts else ("", 0)


def _operands(text: str) -> tuple[str, ...]:
    """Splits at commas outside parentheses. Drops the text that objdump adds after a code address."""
    parts, depth, start = [], 0, 0
    text = text.split(" <")[0].strip()
    for n, c in enumerate(text):
        depth += (c == "(") - (c == ")")
        if c == "," and depth == 0:
            parts.append(text[start:n])
            start = n + 1
    return tuple(p.strip() for p in (*parts, text[start:]) if p.strip())


def _read_tables(found: ObjectFile, text: str) -> None:
    """A word of a jump table is the distance from the table to the code. Its relocation gives the code's address plus
    the distance from the table's start to this word."""
    section = ""
    for line in text.splitlines():
        if name := _RECORDS.match(line):
            section = name[1]
        elif (record := _RECORD.match(line)) and record[2] == "R_X86_64_PC32" and section.startswith(".rodata"):
            symbol, addend = _relocation(record[3])
            code, start = found.functions.get(symbol, (symbol, 0))
            if code in found.sections:
                found.tables[section, int(record[1], 16)] = (code, start + addend)
