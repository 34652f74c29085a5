# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the command-line tools: errors as one message, progress."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from importlib import import_module

from .errors import BagError, BusError, MapError, TwinError, ViewError

EXIT_INCOMPLETE = 1
EXIT_BAD_INPUT = 2
VIEWS_HELP = """\
machine JSON, simulation JSON or a file with a `views` block alone: its panels and body, instead of the run's own"""
MSG_PATH_HELP = """\
folder with <package>/msg/<name>.msg, for bags without definitions; may be repeated; before installed packages"""
TIME_HELP = "the one clock of all times (default: header, if all topics have headers; else log, the time of recording)"
_PROGRESS_PERIOD_S = 2.0
_BAR_PERIOD_S = 0.2
_BAR_WIDTH = 30


def run_tool(name: str, module: str, arguments: Sequence[str]) -> int:
    """The exit status of `main` of a module of simclient."""
    return guarded(name, lambda: import_module(f"simclient.{module}").main(arguments))


def guarded(name: str, work: Callable[[], int]) -> int:
    """The exit status of a tool's work. Wrong input, and a package that is missing, give one message and exit status 2."""
    try:
        status = work()
        sys.stdout.flush()
    except (TwinError, BagError, BusError, MapError, ViewError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        status = EXIT_BAD_INPUT
    except ModuleNotFoundError as error:
        print(f"{name}: error: {missing_package(error)}", file=sys.stderr)
        status = EXIT_BAD_INPUT
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            status = 128 + signal.SIGPIPE  # as of a program that the signal ends: the reader wanted no more
        else:
            place = f"{error.filename}: " if error.filename else ""
            print(f"{name}: error: {place}{error.strerror}", file=sys.stderr)
            status = EXIT_BAD_INPUT
    except KeyboardInterrupt:
        status = 128 + signal.SIGINT
    return status


#: The names of packages that are not those of their modules.
_PACKAGES = {"prometheus_client": "prometheus-client", "rerun": "rerun-sdk", "yaml": "pyyaml", "zenoh": "eclipse-zenoh"}


def missing_package(error: ModuleNotFoundError) -> str:
    """The message for a Python package that is not installed. Raises the error again if it is one of FCSL."""
    module = (error.name or "").partition(".")[0]
    if not module or module.startswith(("fcsl", "simclient")):
        raise error
    package = _PACKAGES.get(module, module)
    return f"it needs the Python package {package}: python3 -m pip install {package}; the wheel's extra `fcsl[all]` brings all"


def completeness(name: str, damage: str) -> int:
    """Exit status of a tool that read a whole bag; prints `damage` (`Bag.truncated`) on stderr if there is any."""
    if not damage:
        return 0
    print(f"{name}: the bag is incomplete: {damage}", file=sys.stderr)
    return EXIT_INCOMPLETE


class Progress:
    """Reports the progress of a long job on stderr: a bar on a terminal, else a line every two seconds.

    A short job prints nothing. The bar is erased when the job is done.
    """

    def __init__(self, what: str, total: int):
        self._what = what
        self._total = max(1, total)
        self._bar = sys.stderr.isatty()
        self._period_s = _BAR_PERIOD_S if self._bar else _PROGRESS_PERIOD_S
        self._next = time.monotonic() + self._period_s
        self._drawn = False

    def at(self, done: int) -> None:
        if self._bar and done >= self._total:
            self.finish()
        if time.monotonic() < self._next or done >= self._total:
            return
        self._next = time.monotonic() + self._period_s
        text = f"{100 * done // self._total} % ({done} of {self._total})"
        if self._bar:
            filled = "#" * (_BAR_WIDTH * done // self._total)
            print(f"\r{self._what}: [{filled:<{_BAR_WIDTH}}] {text}", end="", file=sys.stderr, flush=True)
            self._drawn = True
        else:
            print(f"{self._what}: {text}", file=sys.stderr, flush=True)

    def finish(self) -> None:
        """Erases the bar, if there is one."""
        if self._drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._drawn = False
