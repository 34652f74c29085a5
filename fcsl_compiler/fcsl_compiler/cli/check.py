# SPDX-License-Identifier: Apache-2.0
"""`fcsl check`: reports errors and writes nothing."""

from __future__ import annotations

import argparse
from os.path import lexists

from ..base.diagnostics import Diagnostic, DiagnosticError
from ..driver.passes import compile_machine
from .report import Summary, print_report


def run(options: argparse.Namespace) -> int:
    found: list[Diagnostic] = []
    passed: list[Summary] = []
    for path in options.config:
        try:
            compilation = compile_machine(path, "", until="verify", strict=options.strict)
        except DiagnosticError as error:
            found += error.diagnostics
            continue
        found += compilation.sink.diagnostics
        passed.append(Summary(path, compilation.checked))
    if options.format == "text":
        for machine in passed:
            print(machine.text())
    print_report(options, found, passed)
    if len(passed) == len(options.config):
        return 0
    return 1 if all(lexists(path) for path in options.config) else 2
