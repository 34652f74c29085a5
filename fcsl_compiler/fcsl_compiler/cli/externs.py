# SPDX-License-Identifier: Apache-2.0
"""`fcsl externs`: the link inputs of a target, for build systems."""

from __future__ import annotations

import argparse

from ..base.diagnostics import DiagnosticSink
from ..parse.machine_files import parse_machine
from ..parse.targets import choose_target


def run(options: argparse.Namespace) -> int:
    """Prints one line per link input, for build systems that need them before compilation."""
    found: dict[str, None] = {}
    for path in options.config:
        sink = DiagnosticSink()
        parsed = parse_machine(path, sink)
        sink.raise_if_failed()
        assert parsed is not None
        at = parsed.keys["targets"].span if "targets" in parsed.keys else parsed.source.whole()
        target = choose_target(parsed.targets, options.target, at)
        found |= {f"source {p.absolute()}": None for p in target.sources}
        found |= {f"include {p.absolute()}": None for p in target.include}
        found |= {f"archive {p.absolute()}": None for p in target.archives}
        found |= {f"library {name}": None for name in target.libraries}
    print("".join(f"{line}\n" for line in found), end="")
    return 0
