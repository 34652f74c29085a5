# SPDX-License-Identifier: Apache-2.0
"""The example in the help of a command. A test parses each with the parser that shows it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from .command import Command


def add_examples(parser: argparse.ArgumentParser, examples: Mapping[str, str]) -> None:
    """Adds to the help of a parser and of the commands below it: command (`cut`, `calibrate gyro`; empty: the parser itself) to
    the arguments behind its name. Help keeps the line breaks of descriptions and epilogs then."""
    for path, arguments in examples.items():
        found = parser
        for name in path.split():
            found = subcommands(found)[name]
        settings = found.settings if isinstance(found, Command) else vars(found)
        epilog = settings.get("epilog")
        settings["formatter_class"] = argparse.RawDescriptionHelpFormatter
        settings["epilog"] = f"example: {settings['prog']} {arguments}".rstrip() + (f"\n\n{epilog}" if epilog else "")


def subcommands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Those right below a parser; the options of a Command are not made yet."""
    found: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found.update(action.choices)
    return found
