# SPDX-License-Identifier: Apache-2.0
"""`fcsl explain`: the page of a diagnostic code or of a function."""

from __future__ import annotations

import argparse

from ..base.codes.code import Code
from ..base.codes.pages import UnknownCode, pages
from ..base.diagnostics import nearest
from ..base.usage_error import UsageError
from ..base.verb import installed
from .function_page import function_names, function_page


def run(options: argparse.Namespace) -> int:
    try:
        texts = [function_page(word) or pages([word], codes()) for word in options.what]
    except UnknownCode as error:
        like = [nearest(word, function_names()) for word in options.what if not word[-1:].isdigit()]
        raise UsageError("; ".join([str(error), *filter(None, like)])) from None
    print("\n".join(texts) if texts else f"{pages([], codes())}\nfunctions: {', '.join(function_names())}\n", end="")
    return 0


def codes() -> dict[str, Code]:
    """Those of all installed packages of FCSL, sorted: errors, then warnings."""
    return dict(sorted({code: row for package in installed() for code, row in package.codes().items()}.items()))
