# SPDX-License-Identifier: Apache-2.0
"""`fcsl cover`: runs a command and reports the coverage of a machine's algorithms."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..coverage.probe_map import CoverError
from ..coverage.report import make_report, parse_limits, refuse_foreign
from ..coverage.settings import COVER_DIR

#: Time in s that a command may take to end after Ctrl-C.
_TIDY_UP_S = 10.0


def run(options: argparse.Namespace) -> int:
    if not options.command:
        example = "fcsl cover MACHINE.json -- python3 -m pytest test"
        raise UsageError(f"cover: no command to run; write it after `--`: {example}")
    try:
        limits = parse_limits(options.fail_under)
        for config in options.config:
            if not config.is_file():
                raise UsageError(f"cover: no such machine: {config}")
            if config.suffix != ".json":
                raise UsageError(f"cover: `{config}` is not a machine's JSON file; name the machine that the tests run")
        if options.output is not None:
            refuse_foreign(options.output)
        with tempfile.TemporaryDirectory(prefix="fcsl-cover-") as folder:
            environment = {**os.environ, COVER_DIR: folder}
            status = _run(options.command, environment)
            report = make_report(Path(folder), options.config)
    except CoverError as error:
        raise UsageError(f"cover: {error}") from None
    print(report.text(), end="")
    if options.output is not None:
        write_whole(options.output, report.to_json())
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
