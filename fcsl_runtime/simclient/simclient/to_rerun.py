# SPDX-License-Identifier: Apache-2.0
"""fcsl rerun BAG -o run.rrd: a run for the rerun viewer (see simclient.view.rrd).

Exit status 0: written. 1: written, but the bag is incomplete. 2: bad input, nothing written.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples

from .cli import VIEWS_HELP, completeness

_EXAMPLES = {
    "": "flight -o flight.rrd",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl rerun",
        description="Converts a recorded run for rerun. The first page has the panels and the body of the run's views.",
    )
    parser.add_argument("bag", help="directory, or one of its files")
    parser.add_argument("-o", "--output", metavar="FILE", required=True, help="file to write: run.rrd")
    parser.add_argument("--views", default="", metavar="FILE", help=VIEWS_HELP)
    parser.add_argument("--machine", metavar="NAME", default="", help="the machine, if the bag holds several")
    parser.add_argument(
        "--truth", metavar="TOPIC", default="", help="topic of the plant's truth (default: all below /<namespace>/sim/)"
    )
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    """Parses the arguments, writes the file; returns the exit code. Raises BagError."""
    options = make_parser().parse_args(arguments)
    # Imported here, because the imports take a second; inside run_tool, Ctrl-C meanwhile gives no traceback.
    from .bag.formats import open_bag
    from .view.rrd import to_rerun
    from .view.views import read_views

    views = read_views(options.views) if options.views else None
    bag = open_bag(options.bag)
    left_out = to_rerun(bag, options.output, options.machine, options.truth, views=views)
    print(f"{options.output}: {Path(options.output).stat().st_size} bytes; view it with: rerun {options.output}")
    if left_out:
        print(f"left out of the first page: {', '.join(left_out)}")
    return completeness("fcsl rerun", bag.truncated)
