# SPDX-License-Identifier: Apache-2.0
"""FCSL without a workspace: this folder is the prefix with native programs, libraries, headers and models."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version
from pathlib import Path

__version__ = version("fcsl")


def run_native() -> None:
    """The program of the prefix that is called as this process is."""
    program = Path(__file__).parent / "bin" / Path(sys.argv[0]).name
    os.execv(program, [program.name, *sys.argv[1:]])
