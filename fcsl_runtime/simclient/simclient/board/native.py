# SPDX-License-Identifier: Apache-2.0
"""ctypes structs and prototypes of libfcsl_board.so: boards, their devices, and the drivers that come with FCSL."""

from __future__ import annotations

import ctypes
import functools
from ctypes import POINTER, Structure, c_char_p, c_double, c_int, c_int32, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path

from ..c_run import CError
from ..library import bind_runtime, runtime_library

#: FCSL_VALUES_MAX
VALUES = 24


class CReading(Structure):
    """fcsl_reading_t"""

    _fields_ = [("sample_ns", c_uint64), ("backend", c_uint32), ("values", c_double * VALUES)]


class CSensorReading(Structure):
    """sensor_reading_t"""

    _fields_ = [("sensor", c_uint32), ("reading", CReading)]


class COutput(Structure):
    """fcsl_frontend_output_t"""

    _fields_ = [("primary", c_int32), ("fresh", c_int), ("sample_ns", c_uint64), ("values", c_double * VALUES)]


class CCounts(Structure):
    """device_counts_t"""

    _fields_ = [
        (name, c_uint64)
        for name in ("samples", "errors", "dropped", "lost", "open", "bytes", "frames", "rejected", "why")
    ]


#: DEVICE_VALUES_MAX
_DEVICE_VALUES = 64


class CSample(Structure):
    """device_sample_t"""

    _fields_ = [("sample_ns", c_uint64), ("values", c_double * _DEVICE_VALUES)]


_ERROR = POINTER(CError)
_PROTOTYPES: dict[str, tuple[type | None, list[type]]] = {
    "board_open": (ptr, [c_char_p, ptr, _ERROR]),
    "board_take": (None, [ptr, c_uint32, POINTER(CReading)]),
    "board_tick": (c_int, [ptr, c_uint64, _ERROR]),
    "board_output": (POINTER(COutput), [ptr, c_uint32]),
    "board_condition": (c_int, [ptr, c_uint32, c_uint32]),
    "board_close": (None, [ptr]),
    "board_plan": (ptr, [ptr]),
    "board_plan_read": (ptr, [c_char_p, _ERROR]),
    "board_plan_free": (None, [ptr]),
    "board_devices_new": (ptr, [ptr, _ERROR]),
    "board_devices_use": (c_int, [ptr, c_uint32, c_char_p, _ERROR]),
    "board_devices_latest": (POINTER(CSample), [ptr, c_uint32]),
    "board_devices_start": (c_int, [ptr, c_int, _ERROR]),
    "board_devices_take": (c_uint32, [ptr, POINTER(CSensorReading), c_uint32]),
    "board_devices_counts": (CCounts, [ptr, c_uint32]),
    "board_devices_news": (c_char_p, [ptr]),
    "board_devices_free": (None, [ptr]),
    "board_why_text": (c_char_p, [c_uint64]),
}


@functools.cache
def _load(path: Path) -> ctypes.CDLL:
    return bind_runtime(path, _PROTOTYPES)


def board_library() -> ctypes.CDLL:
    """Raises TwinError."""
    return _load(runtime_library().with_name("libfcsl_board.so"))


def why_text(number: int) -> str:
    """Why a device is silent, by its fcsl_driver_why_t; "" where it is not. Raises TwinError."""
    return str(board_library().board_why_text(number).decode())
