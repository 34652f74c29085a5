# SPDX-License-Identifier: Apache-2.0
"""simclient's verbs of `fcsl`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from importlib import import_module

from fcsl_compiler.api.command_line import Commands, Verb

from .cli import run_tool

_MACHINES, _RECORDINGS, _RUNNING, _HARDWARE = "machines", "recordings", "running machines", "hardware"
_FLIGHT_PROGRAM = "fcsl-fc"


def _parser(module: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = import_module(f"simclient.{module}").make_parser()
    return parser


def _verb(name: str, group: str, module: str, text: str) -> tuple[str, Verb]:
    return name, Verb(group, text, partial(run_tool, f"fcsl {name}", module), parser=partial(_parser, module))


def _complete_var(words: list[str]) -> list[str]:
    from .vars.complete import complete

    return complete(words)


def _fly(arguments: Sequence[str]) -> int:
    """Becomes the flight program."""
    try:
        os.execvp(_FLIGHT_PROGRAM, [_FLIGHT_PROGRAM, *arguments])
    except OSError as error:
        print(f"fcsl fly: error: {_FLIGHT_PROGRAM}: {error.strerror}; it comes with fcsl_runtime", file=sys.stderr)
    return 2


_, _VAR = _verb("var", _RUNNING, "vars.cli", "read and write the values of a running machine")
COMMANDS = Commands(
    verbs=dict(
        [
            _verb("replay", _RECORDINGS, "replay.command", "run a machine on a bag, and compare its outputs"),
            _verb("bag", _RECORDINGS, "bag.command", "describe, cut, compare, export, digest and repair bags"),
            _verb("plot", _RECORDINGS, "plot", "draw a bag, or a simulation"),
            _verb("rerun", _RECORDINGS, "to_rerun", "convert a bag for the rerun viewer"),
            _verb("check-bag", _RECORDINGS, "replay.check_bag", "judge the requirements of a machine on a bag"),
            _verb("trace", _MACHINES, "trace.command", "say what tests, campaigns and proofs show of each requirement"),
            _verb("adopt", _MACHINES, "adopt", "write the values of a parameter file into a machine JSON"),
            ("fly", Verb(_RUNNING, "run a machine as a process of its own: fcsl-fc", _fly)),
            ("var", _VAR._replace(complete=_complete_var)),
            _verb("view", _RUNNING, "live.cli", "show a running machine in the rerun viewer"),
            _verb("bus", _RUNNING, "bus.cli", "list, print, record and play the channels of machines on the bus"),
            _verb("link", _RUNNING, "link.watch", "show the counters of a flight program's link"),
            _verb(
                "supervisor", _RUNNING, "supervisor.service", "start, stop and show flights and simulations over HTTP"
            ),
            _verb("hal", _HARDWARE, "hal.cli", "list, describe, monitor, calibrate and test sensors and actuators"),
        ]
    )
)
