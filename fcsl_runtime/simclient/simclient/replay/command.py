# SPDX-License-Identifier: Apache-2.0
"""fcsl replay: runs a recorded machine again and compares every output of every tick, bit for bit.

    fcsl replay BAG --config lander_control.json
    fcsl replay BAG --library liblander_control.so
    fcsl replay BAG --library liblander_control.so --board board.plan    # its sensors, too, from readings
    fcsl replay BAG --config ahrs.json --map map.yaml -o OUT     # a bag that FCSL did not record, of any format

Exit status 0: identical (with --map: ran to the end and met the map's expectations). 1: differs, or the bag is
incomplete. 2: bad input.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples

from ..bag.formats import open_bag
from ..cli import MSG_PATH_HELP, completeness
from ..complete_output import check_target
from ..errors import MapError
from . import mapping
from .replaying import replay, replay_foreign


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Also of `ros2 fcsl replay`."""
    parser.description = "Replays a recorded run, bit for bit; or runs a machine on a bag that FCSL did not record."
    parser.epilog = mapping.__doc__
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("bag", help="directory, or one of its files: .mcap, .db3, .bag (ROS 1), .zstd")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--config", metavar="FILE", default="", help="machine JSON")
    which.add_argument("--library", metavar="FILE", default="", help="compiled machine library")
    parser.add_argument("--machine", metavar="NAME", default="", help="the machine, if there are several")
    parser.add_argument(
        "--ignore-source-hash",
        action="store_true",
        help="replay with changed sources and the recorded parameters; lists parameters whose compiled value differs",
    )
    parser.add_argument(
        "--from-tick",
        type=int,
        metavar="TICK",
        help="begin at the last checkpoint at or before this tick; not with --map or --board",
    )
    board_help = "plan of a board: the recorded readings of its devices go through its frontends again"
    parser.add_argument("--board", default="", metavar="PLAN", help=board_help)
    parser.add_argument("--json", action="store_true", help="print the verdict as one JSON object; not with --map")
    parser.add_argument("--map", metavar="FILE", default="", help="map file for a bag that FCSL did not record")
    parser.add_argument("-o", "--output", metavar="BAG", help="with --map: bag to write")
    parser.add_argument(
        "--namespace", metavar="NAMESPACE", default="", help="with --map -o: ROS namespace of the topics written"
    )
    parser.add_argument("--expect", metavar="FILE", help="with --map: file with `expect`, in place of the map's")
    parser.add_argument(
        "--plot", metavar="FILE", help="with --map: picture of expected and actual values (.png, .svg, .pdf)"
    )
    parser.add_argument(
        "--msg-path", action="append", default=[], metavar="FOLDER", help=f"with --map: {MSG_PATH_HELP}"
    )


def _main_foreign(options: argparse.Namespace) -> int:
    """The command with --map."""
    if options.plot:
        from . import expect_plot

        expect_plot.check_name(options.plot)
        check_target(options.plot)
    if options.output:
        check_target(options.output, is_new=True)
    opened = open_bag(options.bag, options.msg_path)
    done = replay_foreign(
        opened,
        options.map,
        options.config,
        options.library,
        options.output,
        options.machine,
        options.namespace,
        options.expect,
    )
    print(done)
    if options.plot:
        if not done.comparisons:
            raise MapError(f"{options.expect or options.map}: nothing is expected, so there is nothing to plot")
        expect_plot.plot(done.comparisons, f"{Path(options.map).name}: {opened.path.name}", options.plot)
    incomplete = completeness("fcsl replay", done.truncated)
    return incomplete or (0 if all(comparison.holds for comparison in done.comparisons) else 1)


_EXAMPLES = {
    "": "flight --config craft.json",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl replay", description="Runs a machine on a bag, and compares its outputs."
    )
    add_arguments(parser)
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    parser = make_parser()
    return command(parser, parser.parse_args(arguments))


def command(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """What the arguments of `add_arguments` ask for; the exit code."""
    for name in ("output", "namespace", "expect", "plot", "msg_path"):
        if getattr(options, name) and not options.map:
            parser.error(f"{'-o' if name == 'output' else '--' + name.replace('_', '-')} needs --map")
    if options.map and options.board:
        parser.error("--board needs a flight that FCSL recorded, and --map is for other bags")
    if options.from_tick is not None and (options.map or options.board):
        parser.error("--from-tick goes with neither --map nor --board")
    if options.map and options.json:
        parser.error("--json does not go with --map")
    if options.map:
        return _main_foreign(options)
    ignore = options.ignore_source_hash
    verdict = replay(
        options.bag, options.config, options.library, options.machine, ignore, options.board, options.from_tick
    )
    for note in verdict.notes:
        print(f"fcsl replay: {note}", file=sys.stderr)
    if options.json:
        print(json.dumps({"identical": verdict.identical, **asdict(verdict)}, indent=2))
    else:
        print(verdict)
    return 0 if verdict.identical else 1
