# SPDX-License-Identifier: Apache-2.0
"""stimulus.c in this process: for a machine that CPython runs, and for one in the simulator."""

from __future__ import annotations

import ctypes
import tempfile
from ctypes import POINTER, Structure, byref, c_uint32, c_uint64, c_void_p
from functools import cache
from pathlib import Path

from fcsl_compiler.driver.toolchain import include_dirs
from simclient.c_machine import CField, CMachine
from simclient.twin.python_run import CHardware, CHost

from .cases import SHARED, run


class CStimulusHost(Structure):
    """stimulus_host_t"""

    _fields_ = [("seed", c_uint64), ("tick", c_uint64), ("written", c_uint64), ("hw", CHardware), ("host", CHost)]


#: Result and arguments of the functions of stimulus.h.
_FUNCTIONS = {
    "stimulus_begin": (None, [POINTER(CMachine), c_void_p]),
    "stimulus_tick": (None, [POINTER(CMachine), c_void_p, c_uint64, c_uint64]),
    "stimulus_host_begin": (None, [POINTER(CStimulusHost), c_uint64]),
    "stimulus_hash": (c_uint64, [POINTER(CMachine), c_void_p, c_uint64]),
    "stimulus_word": (c_uint64, [POINTER(CField), c_void_p, c_uint32]),
    "stimulus_mix": (c_uint64, [c_uint64, c_uint64]),
}


@cache
def library() -> ctypes.CDLL:
    """Compiled once a process. Raises CheckFailed."""
    with tempfile.TemporaryDirectory(prefix="fcsl-stimulus-") as folder:
        path = Path(folder) / "stimulus.so"
        includes = [f"-I{d}" for d in include_dirs()]
        run(["gcc", "-std=c11", "-O2", "-fPIC", "-shared", *includes, SHARED / "stimulus.c", "-o", path])
        found = ctypes.CDLL(str(path))
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(found, name)
        function.restype, function.argtypes = result, arguments
    return found


def host(seed: int) -> CStimulusHost:
    """For step; the caller keeps its tick."""
    made = CStimulusHost()
    library().stimulus_host_begin(byref(made), seed)
    return made
