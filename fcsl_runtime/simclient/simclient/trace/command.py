# SPDX-License-Identifier: Apache-2.0
"""fcsl trace: which code, tests, campaigns and proofs each requirement of a machine has, the gaps first.

    fcsl test --fcsl-requirements tests.json
    fcsl trace lander_control.json --tests tests.json --campaign touchdown.campaign -o trace.html

Exit status 0: tests that passed exercised each requirement, and no test, campaign or proof speaks against one. 1: there are
gaps. 2: bad input.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples
from fcsl_compiler.api.files import write_whole

from .matrix import Files, matrix
from .output import as_csv, as_html, as_json, as_text

FORMATS = (".html", ".json", ".csv")
_EXAMPLES = {"": "craft.json --tests tests.json"}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl trace", description="Says what tests, campaigns and proofs show of each requirement; the gaps first."
    )
    parser.add_argument("config", help="machine JSON")
    parser.add_argument(
        "--tests",
        action="append",
        default=[],
        metavar="FILE",
        help="of `fcsl test --fcsl-requirements FILE`; may be repeated",
    )
    parser.add_argument(
        "--campaign", action="append", default=[], metavar="FOLDER", help="results of a campaign; may be repeated"
    )
    parser.add_argument(
        "--cover", metavar="FILE", help="of `fcsl cover --output FILE`: MC/DC of what assigns its fields"
    )
    parser.add_argument("--proofs", metavar="FILE", help="of `fcsl prove --json`")
    parser.add_argument("-o", "--output", metavar="FILE", help=f"the matrix as {', '.join(FORMATS)}")
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    parser = make_parser()
    options = parser.parse_args(arguments)
    target = Path(options.output) if options.output else None
    if target is not None and target.suffix not in FORMATS:
        parser.error(f"-o {target}: the name of a matrix ends in {', '.join(FORMATS)}")
    rows = matrix(options.config, Files(options.tests, options.campaign, options.cover, options.proofs))
    print(as_text(rows))
    if target is not None:
        texts = {
            ".json": lambda: as_json(rows),
            ".csv": lambda: as_csv(rows),
            ".html": lambda: as_html(rows, f"Requirements of {Path(options.config).stem}"),
        }
        write_whole(target, texts[target.suffix]())
    return int(any(row.gaps for row in rows))
