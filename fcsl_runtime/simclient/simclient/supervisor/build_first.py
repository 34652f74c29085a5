# SPDX-License-Identifier: Apache-2.0
"""Compiles a machine JSON, or takes its library from the cache, and then executes the flight program on it.

python3 -P -m simclient.supervisor.build_first PROGRAM CONFIG ARGUMENT...
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from ..cli import run_tool
from ..machine_build import build_config


def main(arguments: Sequence[str]) -> int:
    """Returns only by an exception. Raises TwinError and OSError."""
    program, config, *more = arguments
    library, _ = build_config(config)
    os.execv(program, [program, str(library), *more])


if __name__ == "__main__":
    sys.exit(run_tool("fcsl supervisor", "supervisor.build_first", sys.argv[1:]))
