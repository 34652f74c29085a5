# SPDX-License-Identifier: Apache-2.0
"""ctypes structs of fcsl_driver.h, and the function that finds a driver by its name."""

from __future__ import annotations

import ctypes
import functools
import os
from ctypes import CFUNCTYPE, POINTER, Structure, byref, c_char_p, c_int, c_size_t, c_uint8, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path

from ..c_run import CError
from ..errors import TwinError
from ..library import bind_runtime, runtime_library

#: fcsl_direction_t
SENSOR, ACTUATOR = 0, 1
#: fcsl_driver_status_t
OK, NOTHING, ABSENT, FAILED = range(4)
#: fcsl_driver_why_t, those that a host finds itself
NO_BYTES, NO_FRAMES = 1, 2
#: fcsl_driver_use_t
UNUSED, NEEDED, OPTIONAL = range(3)
REASON_BYTES = 256
#: By fcsl_type_t, FCSL_BOOL to FCSL_F64: name and ctypes scalar.
SCALARS = (
    ("bool", ctypes.c_bool),
    ("i32", ctypes.c_int32),
    ("i64", ctypes.c_int64),
    ("u32", ctypes.c_uint32),
    ("u64", ctypes.c_uint64),
    ("f32", ctypes.c_float),
    ("f64", ctypes.c_double),
)


class CSignal(Structure):
    """fcsl_driver_signal_t"""

    _fields_ = [
        ("name", c_char_p),
        ("type", c_uint8),
        ("count", c_uint32),
        ("offset", c_uint32),
        ("unit", c_char_p),
        ("doc", c_char_p),
    ]


class CInput(Structure):
    """fcsl_driver_input_t"""

    _fields_ = [("bytes", c_uint32), ("frames", c_uint32), ("rejected", c_uint32), ("why", c_uint32)]


class CDriver(Structure):
    """fcsl_driver_t. A reason is a buffer of its own, not a Python string."""

    _fields_ = [
        ("abi_version", c_uint32),
        ("name", c_char_p),
        ("doc", c_char_p),
        ("direction", c_uint8),
        ("signals", POINTER(CSignal)),
        ("signal_count", c_uint32),
        ("state_size", c_uint32),
        ("state_align", c_uint32),
        ("waits", c_uint8),
        ("input", c_uint32),
        ("probe", CFUNCTYPE(c_int, c_char_p, ptr, c_size_t)),
        ("open", CFUNCTYPE(c_int, ptr, c_char_p, ptr, ptr, c_size_t)),
        ("read", CFUNCTYPE(c_int, ptr, POINTER(c_uint64), ptr, c_size_t)),
        ("write", CFUNCTYPE(c_int, ptr, ptr, c_size_t)),
        ("close", CFUNCTYPE(None, ptr)),
    ]


@functools.cache
def _load(path: Path) -> ctypes.CDLL:
    return bind_runtime(
        path, {"fcsl_library_driver": (POINTER(CDriver), [c_char_p, c_int, POINTER(ptr), POINTER(CError)])}
    )


def find_driver(name: str, direction: int) -> CDriver:
    """The checked descriptor of NAME or LIBRARY.so:NAME; its library stays loaded. Raises TwinError."""
    error, handle = CError(), ptr()
    found = _load(runtime_library()).fcsl_library_driver(os.fsencode(name), direction, byref(handle), byref(error))
    if not found:
        raise TwinError(error.text.decode(errors="replace"))
    driver: CDriver = found.contents
    return driver
