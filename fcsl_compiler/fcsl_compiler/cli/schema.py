# SPDX-License-Identifier: Apache-2.0
"""`fcsl schema`: the JSON Schema of a kind of file, of whatever packages of FCSL are installed."""

from __future__ import annotations

import argparse

from ..base.usage_error import UsageError
from ..base.verb import installed


def run(options: argparse.Namespace) -> int:
    schemas = {kind: text for package in installed() for kind, text in package.schemas.items()}
    if options.of not in schemas:
        raise UsageError(f"there is no schema of `{options.of[:80]}`; there are those of {', '.join(sorted(schemas))}")
    print(schemas[options.of](), end="")
    return 0
