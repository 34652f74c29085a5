# SPDX-License-Identifier: Apache-2.0
"""The codes of diagnostics, as each package lists its own."""

from ..base.codes.code import Code, Kind

__all__ = [
    "Code",
    "Kind",
]
