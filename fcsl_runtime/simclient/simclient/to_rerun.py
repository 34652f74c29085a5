# SPDX-License-Identifier: Apache-2.0
"""python -m simclient.to_rerun BAG -o run.rrd: a run for the rerun viewer (see simclient.view.rrd).

Exit code 0: written. 1: written, but the bag is incomplete. 2: bad input, nothing written.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.base.version import add_version

from .cli import VEHICLE_RULE, completeness, run_tool


def main(arguments: Sequence[str]) -> int:
    """Parses the arguments, writes the file; returns the exit code. Raises BagError."""
    parser = argparse.ArgumentParser(
        prog="simclient.to_rerun",
        description="Converts a recorded run for rerun.",
        epilog=VEHICLE_RULE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_version(parser, "simclient", __file__)
    parser.add_argument("bag", help="directory or .mcap file")
    parser.add_argument("-o", "--output", required=True, help="file to write: run.rrd")
    parser.add_argument("--machine", default="", help="the machine, if the bag holds several")
    parser.add_argument("--truth", default="", help="topic of the plant's truth (default: all below /<namespace>/sim/)")
    options = parser.parse_args(arguments)
    # Imported here, because the imports take a second; inside run_tool, Ctrl-C meanwhile gives no traceback.
    from .bag import Bag
    from .view.rrd import to_rerun

    bag = Bag(options.bag)
    to_rerun(bag, options.output, options.machine, options.truth)
    print(f"{options.output}: {Path(options.output).stat().st_size} bytes; view it with: rerun {options.output}")
    return completeness("simclient.to_rerun", bag.truncated)


if __name__ == "__main__":
    run_tool("simclient.to_rerun", main)
