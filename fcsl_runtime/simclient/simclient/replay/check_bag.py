# SPDX-License-Identifier: Apache-2.0
"""fcsl check-bag: judges the requirements of a machine on a bag.

    fcsl check-bag FLIGHT --config lander_control.json
    fcsl check-bag FLIGHT --config lander_control.json --requirements more.json
    fcsl check-bag BAG --config ahrs.json --map map.yaml      # a bag that FCSL did not record: runs the machine on it
    fcsl check-bag BAG --requirements more.json --map values.yaml     # without a machine: on the values of the map

Exit status 0: none is violated. 1: one is, or none is decided, or the bag is incomplete. 2: bad input.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from contextlib import closing

from fcsl_compiler.api.command_line import add_examples

from ..bag import Bag
from ..bag.formats import open_bag
from ..cli import MSG_PATH_HELP, completeness
from ..errors import BagError
from ..machine_build import build_config
from ..run import open_run
from .foreign import run_foreign
from .judge import Judgement
from .mapped_values import judge_mapped
from .mapping import read_map, read_value_map
from .recorded_values import judge_recorded
from .transforms import with_transforms

_EXAMPLES = {"": "flight --config craft.json"}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl check-bag", description="Judges the requirements of a machine on a recorded flight, or on any bag."
    )
    parser.add_argument("bag", help="directory, or one of its files: .mcap, .db3, .bag (ROS 1), .zstd")
    parser.add_argument("--config", metavar="FILE", help="machine JSON; without one: --requirements and --map")
    parser.add_argument("--machine", metavar="NAME", default="", help="the machine, if the bag has several")
    own = "file with other requirements than the machine's own"
    parser.add_argument("--requirements", metavar="FILE", help=own)
    parser.add_argument(
        "--map",
        metavar="FILE",
        help="map file for a bag that FCSL did not record: of channels (fcsl replay --help), without --config of values",
    )
    parser.add_argument(
        "--msg-path", action="append", default=[], metavar="FOLDER", help=f"with --map: {MSG_PATH_HELP}"
    )
    parser.add_argument("--json", action="store_true", help="print the verdicts as one JSON object")
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.msg_path and not options.map:
        parser.error("--msg-path needs --map")
    if not options.config and not (options.map and options.requirements):
        parser.error("give --config, or without a machine --requirements and --map")
    bag = open_bag(options.bag, options.msg_path)
    found = _of_machine(bag, options) if options.config else _of_values(bag, options)
    if options.json:
        print(json.dumps(found.as_json(), indent=2))
    else:
        print("\n".join(found.lines()))
    return completeness("fcsl check-bag", bag.truncated) or int(not found.holds)


def _of_values(bag: Bag, options: argparse.Namespace) -> Judgement:
    return judge_mapped(bag, read_value_map(options.map), options.requirements)


def _of_machine(bag: Bag, options: argparse.Namespace) -> Judgement:
    with closing(open_run(*build_config(options.config, requirements=options.requirements))) as run:
        if not run.observed():
            raise BagError(f"{options.config}: the machine has no requirements; name a file of some: --requirements")
        if not options.map:
            return judge_recorded(bag, bag.machine(options.machine or run.machine.name), run)
        chart = read_map(options.map)
        grid = run_foreign(with_transforms(bag, chart.entries, chart.header_time), chart, run).grid
        return Judgement(run.verdicts(), {}, {}, grid.ticks)
