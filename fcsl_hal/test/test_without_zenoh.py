# SPDX-License-Identifier: Apache-2.0
"""A build without Zenoh (-DFCSL_ZENOH=OFF): what stands in place of its Rust, compiled alone."""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path

import pytest

HAL = Path(__file__).resolve().parents[1]
#: fcsl_zenoh_events_t of zenoh_session.h: a context and five functions, of which `release` is the last.
_Release = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class Events(ctypes.Structure):
    _fields_ = [("ctx", ctypes.c_void_p), ("others", ctypes.c_void_p * 4), ("release", _Release)]


@pytest.fixture(scope="module")
def absent(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    library = tmp_path_factory.mktemp("absent") / "libabsent.so"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-I{HAL / 'src'}"]
    subprocess.run(["cc", *flags, HAL / "io/zenoh_absent.c", "-o", library], check=True)
    return ctypes.CDLL(str(library))


def test_it_has_every_function_of_a_session(absent: ctypes.CDLL) -> None:
    declared = set(re.findall(r"\b(fcsl_zenoh_\w+)\(", (HAL / "src/bus/zenoh_session.h").read_text()))
    assert len(declared) > 10
    assert [name for name in sorted(declared) if not hasattr(absent, name)] == []


def test_no_session_opens_and_the_reason_is_said(absent: ctypes.CDLL) -> None:
    released = list[int]()
    events = Events(7, (ctypes.c_void_p * 4)(), _Release(released.append))
    session, error = ctypes.c_void_p(1), ctypes.create_string_buffer(200)
    assert absent.fcsl_zenoh_open(None, b"{}", ctypes.byref(events), ctypes.byref(session), error, len(error)) == -1
    assert session.value is None and released == [7]
    assert error.value.decode() == (
        "built without the bus; build fcsl_hal and what uses it again, with --cmake-args -DFCSL_ZENOH=ON"
    )
