# SPDX-License-Identifier: Apache-2.0
"""Links a program for a bare processor: machines, and what starts and calls them."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from ..driver.toolchain import ToolchainError, compile_objects, include_dirs, run_compiler
from .library import Firmware
from .processors import Processor, bare_metal

_LINK_FLAGS = ("-nostdlib", "-fuse-ld=lld", "-Wl,--gc-sections")


def link_program(
    processor: Processor,
    firmware: Firmware,
    sources: Sequence[Path],
    includes: Sequence[Path],
    script: Path,
    output: Path,
) -> None:
    """Compiles `sources`, with FCSL_MACHINE_BYTES of the first machine, and links them with the library and runtime.c as the
    linker script says. Raises ToolchainError."""
    bytes_ = firmware.machines[0].struct_bytes
    command = [*processor.compile_command, f"-DFCSL_MACHINE_BYTES={bytes_}"]
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".program-") as folder:
        objects = compile_objects(
            [*sources, bare_metal() / "runtime.c"], [*includes, *include_dirs()], Path(folder), command
        )
        line = [*processor.command, *map(str, objects), str(firmware.library), *_LINK_FLAGS, f"-Wl,-T,{script}"]
        try:
            run_compiler([*line, "-o", str(output)])
        except ToolchainError as error:
            if "invalid linker name" in str(error):
                fix = "install lld-19 (Debian and Ubuntu: apt-get install lld-19)"
                raise ToolchainError(f"no linker for {processor.name}: lld does not run; {fix}") from None
            raise
