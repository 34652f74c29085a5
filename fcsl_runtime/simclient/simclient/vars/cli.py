# SPDX-License-Identifier: Apache-2.0
"""fcsl var: reads and writes the values of a running machine from the command line (docs/reference/variables.md)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from .arguments import make_parser

EXIT_REFUSED, EXIT_UNREACHABLE = 1, 2
_UNREACHABLE = ("unreachable", "unnamed", "closed", "timeout", "protocol", "unauthorized")


def main(arguments: Sequence[str]) -> int:
    return _run(make_parser().parse_args(arguments, argparse.Namespace(socket=None, token=None, json=False)))


def _run(chosen: argparse.Namespace) -> int:
    """Imports what the command needs, and runs it."""
    from .wire import VarError

    module, function = chosen.run.split(".")
    try:
        getattr(import_module(f".{module}", __package__), function)(chosen)
    except VarError as error:
        message = str(error).replace('say "allow_non_finite": true', "say --allow-non-finite")
        message += ": name its file, --token FILE" if error.code == "unauthorized" and chosen.token is None else ""
        print(f"fcsl var: {message}", file=sys.stderr)
        return EXIT_UNREACHABLE if error.code in _UNREACHABLE else EXIT_REFUSED
    return 0
