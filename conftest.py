# SPDX-License-Identifier: Apache-2.0
"""For every test of the workspace."""

import os
import signal

from hypothesis import settings

# No test fails for its time: a computer may be busy.
settings.register_profile("fcsl", deadline=None)
settings.load_profile("fcsl")

# What scripts/test.py asks of pytest is asked of its own runs alone, not of those that tests start as users would.
os.environ.pop("PYTEST_ADDOPTS", None)

# A shell starts background jobs with SIGINT ignored, and programs that the tests interrupt would inherit that.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
