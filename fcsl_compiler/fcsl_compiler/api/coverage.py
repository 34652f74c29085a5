# SPDX-License-Identifier: Apache-2.0
"""Coverage of algorithms: the builds that count, and the report."""

from ..coverage.probe_map import CoverError
from ..coverage.report import Report, make_report, parse_limits, refuse_foreign
from ..coverage.settings import COVER_DIR

__all__ = [
    "COVER_DIR",
    "CoverError",
    "Report",
    "make_report",
    "parse_limits",
    "refuse_foreign",
]
