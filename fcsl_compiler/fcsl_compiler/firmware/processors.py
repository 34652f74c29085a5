# SPDX-License-Identifier: Apache-2.0
"""The processors that `fcsl build --processor` knows, and C compilers of others."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path
from typing import NamedTuple

from ..base.packages import package_share
from ..base.usage_error import UsageError
from ..driver.toolchain import FLAGS, ToolchainError, refuse_inexact

#: clang alone has the 128-bit integers of CORE-MATH on a 32-bit processor. Enums are short, as in GCC's ABI for bare ARM.
_CLANG = ("clang-19", "clang")
_ARM = ("-fforce-enable-int128", "-fshort-enums")
#: By name: a double-precision FPU (fpv5-d16) in the M7; the M4 computes with f64 in software.
PROCESSORS = {
    "cortex-m7": ("--target=thumbv7em-none-eabihf", "-mcpu=cortex-m7", *_ARM),
    "cortex-m4": ("--target=thumbv7em-none-eabihf", "-mcpu=cortex-m4", *_ARM),
}
#: Flags for every machine: those of hosts, but for position-independent code, and so that a linker leaves out what is not
#: called and the stack is known.
_FLAGS = (
    *(flag for flag in FLAGS if flag not in ("-fPIC", "-fvisibility=hidden")),
    *("-ffunction-sections", "-fdata-sections", "-fno-unwind-tables", "-fno-asynchronous-unwind-tables"),
    *("-fno-pic", "-fstack-usage"),
)


class Processor(NamedTuple):
    """`name` is that of a folder; `command` is the C compiler with the options of the processor."""

    name: str
    command: tuple[str, ...]
    headers: tuple[str, ...] = ()  # options that name the folder of headers; it is no part of build_hash

    @property
    def machine_flags(self) -> tuple[str, ...]:
        """Flags for every machine; a level of optimisation in the command is taken instead of theirs."""
        chosen = any(word.startswith("-O") for word in self.command)
        return tuple(flag for flag in _FLAGS if not (chosen and flag.startswith("-O")))

    @property
    def compile_command(self) -> tuple[str, ...]:
        """Command that compiles machines."""
        return (*self.command, *self.machine_flags, *self.headers)


def bare_metal() -> Path:
    """The folder of runtime.c and its headers: what compiled code takes of a C library."""
    return package_share("fcsl_compiler") / "bare_metal"


def find_processor(text: str) -> Processor:
    """That of `--processor`: a name of the table, or a C compiler; options may follow either. Raises UsageError,
    ToolchainError."""
    try:
        first, *options = shlex.split(text)
    except ValueError as error:
        raise UsageError(f"--processor `{text}`: {'names nothing' if not text.strip() else error}") from None
    refuse_inexact(options, "--processor")
    if first in PROCESSORS:
        headers = ("-idirafter", str(bare_metal() / "include"))
        return Processor(first, (_clang(first), *PROCESSORS[first], *options), headers)
    if shutil.which(first) is None:
        known = ", ".join(PROCESSORS)
        raise UsageError(
            f"--processor `{first}`: neither a processor that fcslc knows ({known}) nor a C compiler that runs here. Write one "
            f'of them, or a compiler and its options, as in --processor "arm-none-eabi-gcc -mcpu=cortex-m33 -mthumb" (Debian and '
            "Ubuntu: apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi)"
        )
    return Processor(Path(first).name, (first, *options))


def _clang(processor: str) -> str:
    found = next(filter(shutil.which, _CLANG), None)
    if found is None:
        raise ToolchainError(
            f"no C compiler for {processor}: neither `{'` nor `'.join(_CLANG)}` runs; install clang-19 and lld-19 (Debian and "
            "Ubuntu: apt-get install clang-19 lld-19)"
        )
    return found
