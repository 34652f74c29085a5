# SPDX-License-Identifier: Apache-2.0
"""fcsl plot BAG [PATH…]: one picture of a run (see simclient.view.picture).

Exit status 0: written. 1: written, but the bag is incomplete. 2: bad input, nothing written.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples

from .cli import MSG_PATH_HELP, TIME_HELP, VIEWS_HELP, completeness

_EPILOG = """\
Each PATH is a panel; paths with commas between them share one:
  fcsl plot flight filter.outputs.pos_z,lander.outputs.pos_z engine.outputs.throttle -o flight.png
A PATH is that of a field or of an element, or a shell pattern ('*.outputs.pos_z'). That of a struct or of an array draws
all its members. Other topics: '/imu/data:angular_velocity.x'. Without PATH, the bag's views are drawn; where it has
none, a panel for each name and unit of outputs that change, actuators first.

Behind a command a grey band shows what its actuator got, if the bag has it (docs/hardware/arming.md): bags of fcsl sim
do; others show the command alone."""

_EXAMPLES = {
    "": "flight filter.outputs.pos_z,lander.outputs.pos_z engine.outputs.throttle -o flight.png",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl plot",
        description="Draws a recorded run.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("bag", help="directory, or one of its files")
    parser.add_argument("paths", nargs="*", metavar="PATH", help="what to draw: a panel for each")
    help_output = "picture to write: .png, .svg or .pdf (default: the bag's name with .png, here)"
    parser.add_argument("-o", "--output", metavar="FILE", default="", help=help_output)
    parser.add_argument("--against", default="", metavar="PATH", help="the horizontal axis, instead of time")
    parser.add_argument("--time", default="", choices=("header", "log"), help=TIME_HELP)
    parser.add_argument("--views", default="", metavar="FILE", help=VIEWS_HELP)
    parser.add_argument("--machine", metavar="NAME", default="", help="the machine, if the bag holds several")
    parser.add_argument(
        "--truth", metavar="TOPIC", default="", help="topic of the plant's truth (default: all below /<namespace>/sim/)"
    )
    parser.add_argument("--msg-path", action="append", default=[], metavar="FOLDER", help=MSG_PATH_HELP)
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    """Parses the arguments, writes the file; returns the exit code. Raises BagError and ViewError."""
    parser = make_parser()
    options = parser.parse_intermixed_args(arguments)
    if options.paths and options.views:
        parser.error("PATH and --views both choose the panels; give one of them")
    # Imported here, because the imports take a second; inside run_tool, Ctrl-C meanwhile gives no traceback.
    from .bag.formats import open_bag
    from .view.picture import plot
    from .view.views import read_views

    views = read_views(options.views) if options.views else None
    bag = open_bag(options.bag, options.msg_path)
    chosen = {"paths": options.paths, "views": views, "against": options.against, "time": options.time}
    output = options.output or _default_output(Path(options.bag).resolve())
    left_out = plot(bag, output, options.machine, options.truth, **chosen)
    print(f"{output}: {Path(output).stat().st_size} bytes")
    if left_out:
        print(f"left out: {', '.join(left_out)}; fcsl plot BAG PATH… chooses what is drawn")
    return completeness("fcsl plot", bag.truncated)


def _default_output(bag: Path) -> str:
    return f"{bag.stem if bag.is_file() else bag.name}.png"
