# SPDX-License-Identifier: Apache-2.0
"""python -m simclient.plot BAG -o run.png: one picture of a run (see simclient.view.picture).

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
        prog="simclient.plot",
        description="Draws a recorded run.",
        epilog=VEHICLE_RULE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_version(parser, "simclient", __file__)
    parser.add_argument("bag", help="directory or .mcap file")
    parser.add_argument("-o", "--output", required=True, help="picture to write: .png, .svg or .pdf")
    parser.add_argument("--machine", default="", help="the machine, if the bag holds several")
    parser.add_argument("--truth", default="", help="topic of the plant's truth (default: all below /<namespace>/sim/)")
    options = parser.parse_args(arguments)
    # Imported here, because the imports take a second; inside run_tool, Ctrl-C meanwhile gives no traceback.
    from .bag import Bag
    from .view.picture import plot

    bag = Bag(options.bag)
    plot(bag, options.output, options.machine, options.truth)
    print(f"{options.output}: {Path(options.output).stat().st_size} bytes")
    return completeness("simclient.plot", bag.truncated)


if __name__ == "__main__":
    run_tool("simclient.plot", main)
