# SPDX-License-Identifier: Apache-2.0
"""`fcsl test`: pytest, in the interpreter that runs FCSL."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec

_HELP = """\
usage: fcsl test [PATH ...] [OPTIONS OF PYTEST]

Runs the tests of PATH (default: this folder) with pytest, where AlgTwin and the fixtures of FCSL are installed.
Example: fcsl test craft -k landing
`python3 -m pytest --help` lists its options. Exit status: that of pytest: 0 all passed, 1 some failed, 5 none found.
"""


def main(arguments: Sequence[str]) -> int:
    """The exit status of pytest; 2 where it is not installed."""
    if list(arguments) in (["-h"], ["--help"]):
        print(_HELP, end="")
        return 0
    if find_spec("pytest") is None:
        print("fcsl test: error: it needs the Python package pytest: python3 -m pip install pytest", file=sys.stderr)
        return 2
    return subprocess.run([sys.executable, "-m", "pytest", *arguments], check=False).returncode
