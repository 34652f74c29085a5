# SPDX-License-Identifier: Apache-2.0
"""Boards that QEMU emulates: the firmware of a machine, and the process that runs it."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from fcsl_compiler.api.build import ToolchainError
from fcsl_compiler.api.firmware import build_firmware, find_processor, link_program
from fcsl_compiler.api.packages import package_prefix, package_share

from .errors import SimError

#: What the firmware takes of fcsl_hal.
_SOURCES = ("controller.c", "src/codec/*.c", "src/link/*.c", "src/guard/gate.c")
_END_S = 10.0


class Board(NamedTuple):
    """`processor` is a name of `fcsl build --processor`. The firmware's own files are in the folder with the board's name."""

    processor: str
    emulator: tuple[str, ...]


#: By the name that QEMU gives them.
BOARDS = {
    "mps2-an500": Board("cortex-m7", tuple("qemu-system-arm -M mps2-an500 -display none -monitor none".split())),
}


def build(name: str, machine: Path, folder: Path) -> Path:
    """The firmware of a machine for a board, made in `folder`. Raises DiagnosticError, SimError."""
    board = BOARDS[name]
    if shutil.which(board.emulator[0]) is None:
        raise SimError(
            f"no emulator: `{board.emulator[0]}` does not run; install it (Debian and Ubuntu: apt-get install qemu-system-arm)"
        )
    kit = package_share("fcsl_hal") / "firmware"
    sources = [path for pattern in (*_SOURCES, f"{name}/*.c") for path in sorted(kit.glob(pattern))]
    includes = [kit, kit / "src", package_prefix("fcsl_hal") / "include"]
    program = folder / "firmware.elf"
    try:
        processor = find_processor(board.processor)
        made = build_firmware([machine], folder / f"lib{machine.stem}.a", processor)
        link_program(processor, made, sources, includes, kit / name / "memory.ld", program)
    except ToolchainError as error:
        raise SimError(str(error)) from None
    return program


class Emulator:
    """A running board."""

    def __init__(self, process: subprocess.Popen[str]):
        self._process = process

    def checksum(self) -> str:
        """What the firmware prints at its end. Raises SimError."""
        try:
            said, _ = self._process.communicate(timeout=_END_S)
        except subprocess.TimeoutExpired:
            raise SimError(f"the firmware does not end within {_END_S:g} s") from None
        words = said.split()
        if self._process.returncode != 0 or words[-2:-1] != ["fields"]:
            raise SimError(
                f"the firmware ended with status {self._process.returncode}: {said.strip() or 'without a word'}"
            )
        return words[-1]

    def problem(self) -> str:
        """What it said, if it ended before its time; else ""."""
        if self._process.poll() is None:
            return ""
        said, _ = self._process.communicate()
        return f"the firmware ended with status {self._process.returncode}: {said.strip() or 'without a word'}"


@contextmanager
def emulated(name: str, program: Path, address: str) -> Iterator[Emulator]:
    """Runs it, with its serial line connected to tcp:HOST:PORT. It has ended afterwards."""
    line = [*BOARDS[name].emulator, "-serial", f"{address},nodelay=on"]
    line += ["-semihosting-config", "enable=on,target=native", "-kernel", str(program)]
    process = subprocess.Popen(
        line, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )
    try:
        yield Emulator(process)
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
