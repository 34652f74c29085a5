# SPDX-License-Identifier: Apache-2.0
"""fcsl bag: describes, cuts, compares, exports, digests and repairs bags.

    fcsl bag info   BAG
    fcsl bag cut    BAG -o PART --from 2.5 --to 7
    fcsl bag cut    BAG -o PART --state DESCENT --config lander_control.json
    fcsl bag diff   A B --absolute 1e-9
    fcsl bag export BAG -o run.csv --columns 'engine.outputs.*' machine.state
    fcsl bag digest BAG
    fcsl bag repair BAG

Exit status of info, cut, export, digest and repair: 0 done; 1 done, but the bag is incomplete; 2 bad input, nothing written.
Exit status of diff: 0 the bags are the same; 1 they differ, or one is incomplete; 2 bad input.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from decimal import Decimal, InvalidOperation
from pathlib import Path

from fcsl_compiler.api.command_line import add_examples

from ..cli import MSG_PATH_HELP, TIME_HELP, completeness
from ..complete_output import check_target
from ..errors import BagError
from .bag import Bag
from .formats import open_bag
from .stamps import CLOCKS

_CUT_LOSES = """\
What a cut loses. A record replays from a checkpoint: the machine's memory before the first tick of the record. A cut that
begins with that tick replays up to its end. A later cut can be viewed, but it replays only with a new checkpoint. With
--config or --library, the cut replays the record up to its first tick and stores the machine's memory as this checkpoint.
That works if the record itself replays. Messages written on change (health, faults, transitions) are in the cut only
where they changed within it."""
_NS = 1_000_000_000
#: Later than every stamp that a message can have, in ns.
_NEVER = 1 << 63


def _info(options: argparse.Namespace) -> int:
    from .info import describe, facts

    bag = open_bag(options.bag, options.msg_path)
    if options.json:
        print(json.dumps(facts(bag, options.machine, options.time), indent=2))
    else:
        print(describe(bag, options.machine, options.time))
    return completeness("fcsl bag", bag.truncated)


def _cut(options: argparse.Namespace) -> int:
    from ..replay.cut import cut

    check_target(options.output, is_new=True)
    bag = open_bag(options.bag, options.msg_path)
    begin_ns, end_ns = _range(bag, options)
    with ExitStack() as opened:
        replayed = None
        if options.config or options.library:
            from ..machine_build import build_config
            from ..run import open_run

            machine = bag.machine(options.machine)
            library = build_config(options.config)[0] if options.config else Path(options.library).absolute()
            run = open_run(library, machine.name)
            opened.callback(run.close)
            replayed = machine, run
        print(f"{options.output}: {cut(bag, options.output, begin_ns, end_ns, replayed, options.time)}")
    return completeness("fcsl bag", bag.truncated)


def _range(bag: Bag, options: argparse.Namespace) -> tuple[int, int]:
    """First and last time of the cut, in ns."""
    from .states import nth_visit

    begin_ns, end_ns = -_NEVER, _NEVER
    if options.state:
        visit = nth_visit(bag, bag.machine(options.machine), options.state, options.visit)
        begin_ns, end_ns = visit.start_ns, visit.end_ns
    begin_ns = begin_ns if options.begin is None else max(begin_ns, options.begin)
    end_ns = end_ns if options.end is None else min(end_ns, options.end)
    if begin_ns > end_ns:
        raise BagError("the cut ends before it begins")
    return begin_ns, end_ns


def _diff(options: argparse.Namespace) -> int:
    from .compare import Tolerance
    from .diff import diff

    bags = open_bag(options.first, options.msg_path), open_bag(options.second, options.msg_path)
    found = diff(*bags, Tolerance(options.absolute, options.relative), options.topics or ())
    print(found)
    incomplete = [completeness("fcsl bag", f"{bag.path}: {bag.truncated}") for bag in bags if bag.truncated]
    return 0 if found.same and not incomplete else 1


def _export(options: argparse.Namespace) -> int:
    from .export import ELEMENTS_MAX, check_name, select, write

    check_name(options.output)
    bag = open_bag(options.bag, options.msg_path)
    found = select(bag, options.columns or (), options.machine, options.time)
    rows = write(found, options.output)
    fields = sum(len(series.columns) for series in found.series)
    print(f"{options.output}: {rows} rows, {fields} fields, by {found.clock}")
    if found.clock.timeless:
        print(f"left out, because they have no time: {'; '.join(found.clock.timeless)}")
    if found.left_out:
        print(f"left out, because their size differs between messages: {', '.join(found.left_out)}")
    if found.too_large:
        print(
            f"left out, as arrays of over {ELEMENTS_MAX} elements (--columns NAME takes one): {', '.join(found.too_large)}"
        )
    return completeness("fcsl bag", bag.truncated)


def _digest(options: argparse.Namespace) -> int:
    from .digest import digest

    bag = open_bag(options.bag)
    print(digest(bag, options.machine))
    return completeness("fcsl bag", bag.truncated)


def _repair(options: argparse.Namespace) -> int:
    from .repair import repair

    done, missing = repair(options.bag)
    print(done)
    return completeness("fcsl bag", missing)


def _seconds(text: str) -> int:
    """Seconds as ns, exactly."""
    try:
        return int(Decimal(text) * _NS)
    except (InvalidOperation, ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"`{text}` is not a number of seconds") from None


def _not_negative(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError(f"`{text}` is not a finite number of at least 0")
    return number


_EXAMPLES = {
    "": "info flight",
    "info": "flight --json",
    "cut": "flight -o descent --state DESCENT",
    "diff": "a b --absolute 1e-9",
    "export": "flight -o flight.csv --columns engine.outputs.throttle machine.state",
    "digest": "flight",
    "repair": "flight",
}


def make_parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(prog="fcsl bag", description=__doc__, formatter_class=raw)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(
        name: str, run: Callable[[argparse.Namespace], int], text: str, epilog: str = ""
    ) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text, epilog=epilog, formatter_class=raw)
        command.set_defaults(run=run)
        if name != "diff":
            command.add_argument("bag", help="directory, or one of its files")
        if name not in ("diff", "repair"):
            command.add_argument("--machine", metavar="NAME", default="", help="the machine, if the bag holds several")
        if name in ("info", "cut", "export"):
            command.add_argument("--time", default="", choices=CLOCKS, help=TIME_HELP)
        if name not in ("digest", "repair"):
            command.add_argument("--msg-path", action="append", default=[], metavar="FOLDER", help=MSG_PATH_HELP)
        return command

    info = add("info", _info, "describes a bag: topics, times, machines, states visited, writes, damage")
    info.add_argument("--json", action="store_true", help="print one JSON object; times in ns")
    _add_cut(add("cut", _cut, "writes a part of a bag as a new bag, complete or not at all", _CUT_LOSES))
    _add_diff(add("diff", _diff, "compares two bags field by field and shows the first difference"))
    export = add("export", _export, "writes a bag as a table", _EXPORT_NAMES)
    export.add_argument("--columns", nargs="+", metavar="NAME", help="only these columns or topics; * matches anything")
    export.add_argument("-o", "--output", metavar="FILE", required=True, help="file to write: .csv, .parquet or .npz")
    add("digest", _digest, "prints one hash of a machine's run: equal digests mean the same bits in every tick")
    add("repair", _repair, "rewrites metadata.yaml, and the end of MCAP files whose recorder was killed", _REPAIR_KEEPS)
    add_examples(parser, _EXAMPLES)
    return parser


_REPAIR_KEEPS = """\
Messages stay where they are. A part that cannot be read is marked, so that every reader passes over it; `info` goes on
telling of it. A bag that is being recorded is refused. Bags of other formats are not for this command."""
_EXPORT_NAMES = """\
Columns are <instance>.outputs.<field> and machine.state of a recorded machine, <topic>:<field> of any other topic.
CSV and Parquet hold one table with a row per time and a column per array element. NumPy's .npz keeps arrays whole
and has the times of each topic: seconds in CSV, nanoseconds in the other formats. States, healths and transition requests
are words."""


def _add_cut(command: argparse.ArgumentParser) -> None:
    command.add_argument("-o", "--output", metavar="BAG", required=True, help="bag directory to write; must not exist")
    time = "in seconds, as info shows them"
    command.add_argument("--from", dest="begin", type=_seconds, metavar="SECONDS", help=f"first time, {time}")
    command.add_argument("--to", dest="end", type=_seconds, metavar="SECONDS", help=f"last time, {time}")
    command.add_argument(
        "--state", metavar="STATE", default="", help="only the time in which the machine was in this state"
    )
    command.add_argument("--visit", type=int, default=1, metavar="N", help="its n-th visit to that state (default 1)")
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--config", metavar="FILE", default="", help="machine JSON; replays up to the cut to make its checkpoint"
    )
    which.add_argument("--library", metavar="FILE", default="", help="compiled machine library; likewise")


def _add_diff(command: argparse.ArgumentParser) -> None:
    command.add_argument("first", help="bag A")
    command.add_argument("second", help="bag B")
    command.add_argument("--topics", nargs="+", metavar="TOPIC", help="only these; * matches anything")
    command.add_argument(
        "--absolute", metavar="NUMBER", type=_not_negative, default=0.0, help="floats may differ by this much"
    )
    command.add_argument(
        "--relative", metavar="NUMBER", type=_not_negative, default=0.0, help="and by this fraction of the larger one"
    )


def main(arguments: Sequence[str]) -> int:
    """Runs one command; returns the exit code. Raises BagError and TwinError."""
    options = make_parser().parse_args(arguments)
    status: int = options.run(options)
    return status
