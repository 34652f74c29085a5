# SPDX-License-Identifier: Apache-2.0
"""What all command lines have: `--version`, and a command with its help."""

from ..base.command import Command
from ..base.version import add_version, package_version

__all__ = [
    "Command",
    "add_version",
    "package_version",
]
