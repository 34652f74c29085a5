# SPDX-License-Identifier: Apache-2.0
"""`fcsl-sim`: checks, runs and draws simulations; lists and describes models."""

from __future__ import annotations

from collections.abc import Sequence

from .arguments import parse


def main(arguments: Sequence[str] | None = None, program: str = "") -> int:
    """Runs fcsl-sim. `program`: what messages about usage call the command, if it is a verb of `fcsl`. Exit status: 0 if the run completed, 1 if `until` has not held in it or a processor flew another flight, 2 for wrong input, 130 on SIGINT, 143 on
    SIGTERM; the bag is then complete with the ticks done so far.
    """
    options = parse(arguments, program)
    from .command import run_command  # after the command line is understood, because it takes long to load

    return run_command(options)
