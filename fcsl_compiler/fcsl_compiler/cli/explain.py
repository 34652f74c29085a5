# SPDX-License-Identifier: Apache-2.0
"""`fcslc explain`: the page of a diagnostic code or of a function."""

from __future__ import annotations

import argparse

from ..base.codes.pages import UnknownCode, pages, table
from ..base.diagnostics import nearest
from ..base.usage_error import UsageError
from .function_page import function_names, function_page


def run(options: argparse.Namespace) -> int:
    try:
        texts = [function_page(word) or pages([word], table(), "fcsl-sim explain") for word in options.what]
    except UnknownCode as error:
        like = [nearest(word, function_names()) for word in options.what if not word[-1:].isdigit()]
        raise UsageError("; ".join([str(error), *filter(None, like)])) from None
    print("\n".join(texts) if texts else pages([], table(), "fcsl-sim explain"), end="")
    return 0
