# SPDX-License-Identifier: Apache-2.0
"""The end of a process whose work is done."""

from __future__ import annotations

from ctypes import c_int, c_uint32

from .errors import TwinError
from .library import bind_runtime, runtime_library


def exit_within(seconds: float, status: int) -> None:
    """The process ends with `status` after so long at the latest, without handlers of exit, even if a destructor of a
    library hangs and keeps Python's lock. Once per process. Raises TwinError."""
    library = bind_runtime(runtime_library(), {"fcsl_exit_within": (c_int, [c_uint32, c_int])})
    if library.fcsl_exit_within(int(seconds * 1000), status) != 0:
        raise TwinError("no thread can be made that would end the process")
