# SPDX-License-Identifier: Apache-2.0
"""The codes of diagnostics, and the pages that explain them."""

from ..base.codes.code import Code, Kind
from ..base.codes.pages import UnknownCode, pages

__all__ = [
    "Code",
    "Kind",
    "UnknownCode",
    "pages",
]
