# SPDX-License-Identifier: Apache-2.0
"""The floating-point mode of the calling thread (fcsl_fp_mode.h)."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator

from .c_run import load_runtime
from .library import runtime_library


@contextlib.contextmanager
def ieee_mode() -> Iterator[None]:
    """Rounding to nearest, and small numbers stay what they are, as IEEE 754 has it. The caller's mode comes back after it:
    a library of this process may have changed it, and the constants of a machine must not depend on it."""
    runtime = load_runtime(runtime_library())
    callers = runtime.fcsl_run_enter_mode()
    if callers != runtime.fcsl_run_ieee_mode():
        text = (
            "this thread has another floating-point mode than that of IEEE 754: rounding, or small numbers become zero, as "
            "libraries linked with -ffast-math make it. Machines run in the right one; what Python computes does not"
        )
        warnings.warn(text, RuntimeWarning, stacklevel=4)
    try:
        yield
    finally:
        runtime.fcsl_run_leave_mode(callers)
