# SPDX-License-Identifier: Apache-2.0
"""Kills a process before the n-th system call that it makes, whichever of its threads makes it: exactly there, by ptrace."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
from collections.abc import Callable
from typing import Any

_LIBC = ctypes.CDLL(None, use_errno=True)
_LIBC.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
_LIBC.ptrace.restype = ctypes.c_long
_TRACEME, _SYSCALL, _SETOPTIONS = 0, 24, 0x4200
#: System calls are told from signals; threads are followed; an exec is no signal; the child ends with who traces it.
_OPTIONS = 0x01 | 0x08 | 0x10 | 0x100000
_AT_CALL = signal.SIGTRAP | 0x80
_ALL_THREADS = 0x40000000  # __WALL


class CannotTrace(Exception):
    """This system does not let a process trace its child."""


def _ptrace(request: int, pid: int, data: int = 0) -> None:
    if _LIBC.ptrace(request, pid, None, data) < 0:
        raise OSError(ctypes.get_errno(), "ptrace")


def _child(action: Callable[[], Any]) -> int:
    """A child that stops before it does what it shall; its process group is its own."""
    child = os.fork()
    if child == 0:
        try:
            os.setpgid(0, 0)
            _ptrace(_TRACEME, 0)
            os.kill(os.getpid(), signal.SIGSTOP)
            action()
        finally:
            os._exit(0)
    _, status = os.waitpid(child, os.WUNTRACED)
    if not os.WIFSTOPPED(status):
        raise CannotTrace
    _ptrace(_SETOPTIONS, child, _OPTIONS)
    return child


def calls_until_killed(call: int, action: Callable[[], Any]) -> int:
    """Does `action` in a child, which is killed instead of its `call`-th system call, the first being 1.

    Returns how many it began: `call`, or fewer when it ended before. `action` may exec. Raises CannotTrace.
    """
    child = _child(action)
    known, inside, count = {child}, set[int](), 0
    _ptrace(_SYSCALL, child)
    while True:
        thread, status = os.waitpid(-child, _ALL_THREADS)
        if not os.WIFSTOPPED(status):
            if thread == child:
                return count
            continue
        stopped_by, pass_on = os.WSTOPSIG(status), 0
        if stopped_by == _AT_CALL:
            inside ^= {thread}  # a call stops twice: before it and after it
            count += thread in inside and count < call
            if count == call:
                os.kill(child, signal.SIGKILL)
        elif thread in known and stopped_by != signal.SIGTRAP:
            pass_on = stopped_by
        known.add(thread)  # a new thread begins with a stop of its own
        with contextlib.suppress(ProcessLookupError):  # it has been killed meanwhile
            _ptrace(_SYSCALL, thread, pass_on)
