# SPDX-License-Identifier: Apache-2.0
"""`fcsl build --processor`: machines for a processor without an operating system."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..base.usage_error import UsageError
from ..driver.stack import LEAF_BYTES
from ..firmware.code import Sizes
from ..firmware.library import Firmware, build_firmware
from ..firmware.processors import Processor, find_processor
from .progress import progress
from .report import Summary, print_report

_KIND = "fcsl firmware"


def build(options: argparse.Namespace, folder: Path | None, name: str, instances: list[str] | None) -> int:
    """Builds `lib<name>.a` in `folder`, or by default in one that is named after the processor."""
    for option in ("c_only", "depfile", "times"):
        if getattr(options, option, False):
            raise UsageError(f"--processor does not go with --{option.replace('_', '-')}; remove one of them")
    if options.report:
        raise UsageError(
            "--processor reports sizes and stack by itself; instructions are counted for x86-64 alone: remove one of --processor "
            "and --report"
        )
    if options.backend != "c":
        raise UsageError(f"--processor compiles C; remove --backend {options.backend}")
    if options.format == "sarif":
        raise UsageError("--processor does not go with --sarif, which has no place for its report; write --json")
    processor = find_processor(options.processor)
    library = (folder or options.config[0].parent / "build" / processor.name) / f"lib{name}.a"
    with progress(f"fcslc: compiling {library.name} ..."):
        made = build_firmware(options.config, library, processor, options.strict, options.target, instances)
    summaries = [
        Summary(c.path, c.checked, library, m.stack_bytes["step"])
        for c, m in zip(made.compilations, made.machines, strict=True)
    ]
    print_report(
        options, [d for c in made.compilations for d in c.sink.diagnostics], summaries, _document(made, processor)
    )
    if options.format == "text":
        print(_text(made))
    return 0


def _document(made: Firmware, processor: Processor) -> dict[str, Any]:
    machines = [
        {
            "machine": m.name,
            "struct_bytes": m.struct_bytes,
            "functions": m.functions._asdict(),
            "descriptor": m.descriptor._asdict(),
            "stack_bytes": m.stack_bytes,
        }
        for m in made.machines
    ]
    monitors = made.monitors._asdict() if made.monitors is not None else None
    return {
        **{"kind": _KIND, "version": 1, "processor": processor.name, "toolchain": made.compilations[0].toolchain},
        **{"library": str(made.library), "machines": machines, "monitors": monitors, "needs": made.needs},
    }


def _text(made: Firmware) -> str:
    lines = [str(made.library)]
    for m in made.machines:
        lines.append(f"{m.name}: {_parts(m.functions)} in flash; {m.struct_bytes} bytes of state in RAM")
        lines.append(f"{m.name}: {_parts(m.descriptor)} more in flash where the project reads the descriptor")
        lines.append(f"{m.name}: {_stacks(m.stack_bytes)}")
    if made.monitors is not None:
        lines.append(f"requirements: {_parts(made.monitors)} more in flash where the project uses fcsl_monitors")
    return "\n".join([*lines, f"the project gives: {', '.join(made.needs) or 'nothing'}"])


def _parts(sizes: Sizes) -> str:
    """What a linker places; variables are there only if an extern has some."""
    text = f"{sizes.code} bytes of code and {sizes.constants} of constants"
    variables = sizes.data + sizes.zeros
    return text + (f", with {variables} bytes of variables in RAM," if variables else "")


def _stacks(stacks: Mapping[str, int | None]) -> str:
    known = [f"{what} needs at most {bound} bytes of stack" for what, bound in stacks.items() if bound is not None]
    unknown = [f"no bound of the stack of {what}" for what, bound in stacks.items() if bound is None]
    assumed = f" ({LEAF_BYTES} assumed for each function that the project gives)" if known else ""
    return ", ".join([*known, *unknown]) + assumed
