# SPDX-License-Identifier: Apache-2.0
"""`fcslc cover`: runs a command and reports the coverage of a machine's algorithms."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ..base.files import write_whole
from ..base.usage import UsageError
from ..coverage.probe_map import CoverError
from ..coverage.report import make_report, parse_limits, refuse_foreign
from ..coverage.settings import COVER_DIR

#: Time in s that a command may take to end after Ctrl-C.
_TIDY_UP_S = 10.0

_EPILOG = """\
example: fcslc cover lander_control.json --fail-under mcdc=100 -- python3 -m pytest test

Every machine that COMMAND compiles (AlgTwin.from_config, fcsl-sim) is built with coverage probes. Such a build must not
fly, and other hosts reject it. PyTwin and existing libraries are not measured. The same without fcslc:
python3 -m pytest --fcsl-cover.

lines     lines on which a statement begins
branches  both outcomes of every decision (a Boolean expression that is the condition of an `if` or a conditional
          expression, or whose value is used), and for each loop that may run no iteration: one iteration, and none
MC/DC     conditions that decided their decision's outcome independently, both as True and as False (masking MC/DC as in
          DO-178C and CAST-10); a chain a < b < c consists of the conditions a < b and b < c
"""


def add_cover(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Adds the command to fcslc's parser. Arguments after `--` must already be removed (split_command)."""
    cover = commands.add_parser(
        "cover",
        help="run tests, and report which lines, branches and conditions of the algorithms they cover",
        usage="fcslc cover [-h] [--json FILE] [--fail-under KIND=PERCENT] MACHINE.json [...] -- COMMAND ...",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=_EPILOG,
    )
    cover.add_argument("config", type=Path, nargs="+", metavar="MACHINE.json", help="machine to report on")
    cover.add_argument("--json", type=Path, metavar="FILE", help="also write the report to this file, as JSON")
    cover.add_argument(
        "--fail-under",
        action="append",
        default=[],
        metavar="KIND=PERCENT",
        help="exit with 1 if a machine has less; KIND is line, branch or mcdc; repeat for each",
    )
    cover.set_defaults(run=_cover)


def split_command(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Splits the arguments of `fcslc cover` at the first `--`: its own arguments, and the command. For other
    subcommands the second part is empty.

    If `--` is missing, options may belong to the command. They are dropped, so that `_cover` can report the missing
    `--`.
    """
    words = list(arguments)
    if words[:1] != ["cover"]:
        return words, []
    if "--" in words:
        at = words.index("--")
        return words[:at], words[at + 1 :]
    if "-h" in words or "--help" in words:
        return words, []
    return [word for word in words if not word.startswith("-")], []


def _cover(options: argparse.Namespace) -> int:
    if not options.command:
        example = "fcslc cover MACHINE.json -- python3 -m pytest test"
        raise UsageError(f"cover: no command to run; write it after `--`: {example}")
    try:
        limits = parse_limits(options.fail_under)
        for config in options.config:
            if not config.is_file():
                raise UsageError(f"cover: no such machine: {config}")
            if config.suffix != ".json":
                raise UsageError(f"cover: `{config}` is not a machine's JSON file; name the machine that the tests run")
        if options.json is not None:
            refuse_foreign(options.json)
        with tempfile.TemporaryDirectory(prefix="fcsl-cover-") as folder:
            environment = {**os.environ, COVER_DIR: folder}
            status = _run(options.command, environment)
            report = make_report(Path(folder), options.config)
    except CoverError as error:
        raise UsageError(f"cover: {error}") from None
    print(report.text(), end="")
    if options.json is not None:
        write_whole(options.json, report.to_json())
    short = report.below(limits)
    for line in short:
        print(f"fcslc: cover: {line}")
    return status or (1 if short or report.absent else 0)


def _run(command: list[str], environment: dict[str, str]) -> int:
    """Runs the command. Returns its exit status, or 128 plus the signal number if a signal ended it (shell
    convention)."""
    try:
        child = subprocess.Popen(command, env=environment)
    except OSError as error:
        raise UsageError(f"cover: `{command[0]}` does not run: {error.strerror}") from None
    with child:
        try:
            status = child.wait()
        except KeyboardInterrupt:
            status = _interrupted(child)
    return status if status >= 0 else 128 - status


def _interrupted(child: subprocess.Popen[bytes]) -> int:
    """Waits after Ctrl-C, which the command receives as well: it may clean up, and its coverage up to then is reported.
    A second Ctrl-C ends both."""
    try:
        status = child.wait(_TIDY_UP_S)
    except (KeyboardInterrupt, subprocess.TimeoutExpired):
        child.kill()
        raise KeyboardInterrupt from None
    print("fcslc: cover: interrupted; coverage up to then:", file=sys.stderr)
    return status or 128 + signal.SIGINT
