# SPDX-License-Identifier: Apache-2.0
"""Runs a command of fcslc, and reports why it cannot do its work."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from importlib import import_module
from os.path import lexists
from pathlib import Path

from ..base.diagnostics import DiagnosticError
from ..base.packages import PackageNotFound
from ..base.usage_error import UsageError
from ..check.verify import IrError
from ..driver.toolchain import ToolchainError
from .report import document, print_report


def run_command(options: argparse.Namespace) -> int:
    """The exit status: 0; 1 if the input has errors, or a tool failed; 2 for wrong usage, or a file that is not there. Imports the
    module of the command, which has its name."""
    try:
        status: int = import_module(f".{options.subcommand}", __package__).run(options)
        sys.stdout.flush()
        return status
    except DiagnosticError as error:
        print_report(options, error.diagnostics)
        return 1 if all(lexists(path) for path in _named(options)) else 2
    except UsageError as error:
        print(f"fcslc: {error}", file=sys.stderr)
        return 2
    except (ToolchainError, IrError, PackageNotFound) as error:
        _fail(options, str(error))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE  # as of a program that the signal ends: the reader wanted no more
    except OSError as error:
        _fail(options, f"{error.filename or ''}: {error.strerror}")
        return 2 if isinstance(error, FileNotFoundError) else 1
    return 1


def _named(options: argparse.Namespace) -> list[Path]:
    """The files that the command line names."""
    config = getattr(options, "config", [])
    return config if isinstance(config, list) else [config]


def _fail(options: argparse.Namespace, failure: str) -> None:
    """Reports that the tool could not complete its work."""
    print(f"fcslc: {failure}", file=sys.stderr)
    if getattr(options, "format", "text") != "text":
        print(document(options.format, (), failure=failure), end="")
