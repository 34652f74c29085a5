# SPDX-License-Identifier: Apache-2.0
"""A process whose work is done ends, whatever hangs."""

from __future__ import annotations

import subprocess
import sys

import pytest

HANGS = "while True:\n    ctypes.PyDLL(None).pause()"  # which keeps Python's lock


@pytest.mark.parametrize(
    ("then", "seconds", "status"),
    [(HANGS, 0.3, 7), ("signal.setitimer(0, 0.05, 0.05)\n" + HANGS, 0.3, 7), ("", 60.0, 0)],
)
def test_the_end(then: str, seconds: float, status: int) -> None:
    code = (
        "import ctypes, signal\n"
        "from simclient.exit_within import exit_within\n"
        "signal.signal(signal.SIGALRM, lambda *_: None)\n"
        f"exit_within({seconds}, 7)\n{then}"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert (ended.returncode, ended.stderr) == (status, "")
