# SPDX-License-Identifier: Apache-2.0
"""fcslc: checks machines, compiles them, writes their ROS 2 messages and the plans of their boards."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence

from .arguments import parse


def main(arguments: Sequence[str] | None = None, program: str = "fcslc") -> int:
    """Runs fcslc, by the name that messages about usage show. Returns the exit status: 0 success, 1 an error in the program or in its environment, 2 usage error,
    130 interrupted."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # avoid exceptions for characters that it cannot show
            stream.reconfigure(errors="backslashreplace")
    options = parse(sys.argv[1:] if arguments is None else arguments, program)
    try:
        from .command import run_command

        return run_command(options)
    except KeyboardInterrupt:
        print("fcslc: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
