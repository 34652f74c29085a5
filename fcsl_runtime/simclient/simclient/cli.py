# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the command-line tools: errors as one message, progress, output that is complete or absent."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from .errors import BagError, BusError, MapError, TwinError, ViewError

EXIT_INCOMPLETE = 1
EXIT_BAD_INPUT = 2
VIEWS_HELP = """\
machine JSON, simulation JSON or a file with a `views` block alone: its panels and body, instead of the run's own"""
MSG_PATH_HELP = """\
folder with <package>/msg/<name>.msg, for bags without definitions; may be repeated; before installed packages"""
_PROGRESS_PERIOD_S = 2.0
_BAR_PERIOD_S = 0.2
_BAR_WIDTH = 30
#: Errors that only writing raises; they name no file.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def run_tool(name: str, main: Callable[[Sequence[str]], int]) -> NoReturn:
    """Runs `main` with the command line's arguments and exits. Wrong input gives one message and exit code 2."""
    try:
        status = main(sys.argv[1:])
        sys.stdout.flush()
    except (TwinError, BagError, BusError, MapError, ViewError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
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
    sys.exit(status)


def completeness(name: str, damage: str) -> int:
    """Exit code of a tool that read a whole bag; prints `damage` (`Bag.truncated`) on stderr if there is any."""
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


@contextmanager
def complete_or_absent(target: str | Path) -> Iterator[Path]:
    """A temporary path for a file or directory: renamed to `target` if the block succeeds, deleted if it fails.

    The last component of the path is that of `target`, because bags name their files after their directory. Errors of
    the operating system name `target`, because the temporary path means nothing to a user.
    """
    wanted = Path(target).absolute()
    if not wanted.parent.is_dir():
        raise BagError(f"{wanted.parent}: no such directory")
    if wanted.is_dir():
        raise BagError(f"{target}: a directory; name the file to write")
    try:
        scratch = Path(tempfile.mkdtemp(prefix=f".{wanted.name}.", dir=wanted.parent))
    except OSError as error:
        raise BagError(f"{target}: cannot be written: {error.strerror}") from None
    try:
        partial = scratch / wanted.name
        yield partial
        partial.replace(wanted)
    except OSError as error:
        if error.errno not in _NO_ROOM and str(scratch) not in str(error.filename):
            raise
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise BagError(f"{target}: cannot be written: {reason}") from None
    except (BagError, TwinError) as error:
        if str(scratch) not in str(error):
            raise
        raise type(error)(str(error).replace(str(scratch), str(wanted.parent))) from None
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
