# SPDX-License-Identifier: Apache-2.0
"""`fcsl graph`: draws dataflow and state machine."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.diagnostics import nearest
from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..driver.passes import compile_machine
from ..graph import FORMATS, render


def run(options: argparse.Namespace) -> int:
    output: Path | None = options.output
    suffix = output.suffix if output else ".mmd"
    if suffix not in FORMATS:
        raise UsageError(f"-o `{output}`: a picture's name ends in {', '.join(FORMATS)}")
    machine = compile_machine(options.config, "", until="schedule").checked
    names = [s.name for s in machine.states]
    if options.state is not None and options.state not in names:
        hint = nearest(options.state, names) or f"the states are {', '.join(names)}"
        raise UsageError(f"no state `{options.state}`; {hint}")
    state = machine.states[names.index(options.state)] if options.state is not None else None
    text = render(machine, state, suffix, options.fold)
    if output is None:
        print(text, end="")
    else:
        write_whole(output, text)
        print(output)
    return 0
