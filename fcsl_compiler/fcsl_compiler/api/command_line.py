# SPDX-License-Identifier: Apache-2.0
"""What all command lines have: `--version`, and a command with its help."""

from ..base.command import Command
from ..base.examples import add_examples, subcommands
from ..base.verb import Commands, Verb
from ..base.version import add_version, package_version

__all__ = [
    "Command",
    "Commands",
    "Verb",
    "add_examples",
    "add_version",
    "package_version",
    "subcommands",
]
