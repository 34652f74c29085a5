# SPDX-License-Identifier: Apache-2.0
"""`fcsl scan`: checks that machine libraries call only functions allowed in a step."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..base.json_file import read_json
from ..base.usage_error import UsageError
from ..driver.library import check_machine, stack_bounds
from ..driver.stack import bound_text
from .report import print_extern_calls


def run(options: argparse.Namespace) -> int:
    for library in options.library:
        if not library.exists():
            raise UsageError(f"{library}: no such file")
    objects = sorted(options.objects.rglob("*.o")) if options.objects else []
    maps = sorted(options.emitted.glob("*.map.json")) if options.emitted else []
    externs = sorted({name for file in maps for name in _externs_of(file)})
    calls = [call for library in options.library for call in check_machine(library, objects, externs)]
    if options.objects:
        for name, bound in stack_bounds(options.objects, externs).items():
            print(bound_text(name, bound, externs))
    print_extern_calls(calls)
    return 0


def _externs_of(map_file: Path) -> list[str]:
    try:
        return [str(name) for name in read_json(map_file)["externs"]]
    except (ValueError, KeyError, TypeError):
        raise UsageError(f"--emitted: `{map_file}` is not a map of this fcslc version") from None
