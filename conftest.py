# SPDX-License-Identifier: Apache-2.0
"""For every test of the workspace: what scripts/test.sh asks of pytest is asked of its own runs alone, not of those that
tests start as users would."""

import os

os.environ.pop("PYTEST_ADDOPTS", None)
