# SPDX-License-Identifier: Apache-2.0
"""fcsl link: what the link of a running flight program carries, loses and repeats (docs/reference/transports.md)."""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Mapping, Sequence

from fcsl_compiler.api.command_line import add_examples

from ..vars.client import VarClient
from ..vars.find import VARIABLE, find_server, named_address
from ..vars.show import table
from ..vars.wire import VarError

_PREFIX = "hal.link."
_PORT = re.compile(r"port(\d+)\.(\w+)")
EXIT_REFUSED, EXIT_UNREACHABLE = 1, 2

#: Counters by path behind hal.link., and how many of each came per second.
Counters = Mapping[str, int]
Rates = Mapping[str, float]


def main(arguments: Sequence[str]) -> int:
    chosen = make_parser().parse_args(arguments)
    try:
        address = named_address(chosen.socket) or find_server().address
        with VarClient(address, chosen.token) as client:
            _show(client, chosen.period, chosen.count, chosen.json)
    except VarError as error:
        print(f"fcsl link: {error}", file=sys.stderr)
        return EXIT_REFUSED if error.code == "no_link" else EXIT_UNREACHABLE
    except KeyboardInterrupt:
        pass  # the normal end
    return 0


_EXAMPLES = {
    "": "--socket craft.sock --period 1 --count 5",
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl link",
        description="Shows the link of a flight program (fcsl-fc --hal wire:udp:…, tcp:… or uart:…, with --socket): "
        "messages, frames, what was lost, damaged and repeated, as totals and per second.",
        epilog=f"The program is that of --socket, else of {VARIABLE}, else the only one of this user.",
    )
    parser.add_argument("--socket", metavar="ADDRESS", help="address of the program's variable server")
    parser.add_argument("--token", metavar="FILE", help="the token of a TCP server")
    parser.add_argument(
        "--period", type=_seconds, default=1.0, metavar="SECONDS", help="time from one report to the next (default 1)"
    )
    parser.add_argument(
        "--count", type=int, default=0, metavar="N", help="end after N reports; 0 (default): Ctrl-C ends"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object per report: totals and rates")
    add_examples(parser, _EXAMPLES)
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.01 <= value <= 3600:
        raise argparse.ArgumentTypeError("0.01 to 3600 s are possible")
    return value


def _show(client: VarClient, period_s: float, count: int, as_json: bool) -> None:
    paths = client.list(_PREFIX)
    if not paths:
        text = "this program has no link: fcsl-fc has one with --hal wire:udp:…, wire:tcp:… or wire:uart:…"
        raise VarError("no_link", text)
    before, read_s = _read(client, paths), time.monotonic()
    done = 0
    while count == 0 or done < count:
        time.sleep(max(0.0, read_s + period_s - time.monotonic()))
        now, at = _read(client, paths), time.monotonic()
        rates = {name: (now[name] - before[name]) / (at - read_s) for name in now}
        if as_json:
            print(json.dumps({"total": now, "per_second": rates}), flush=True)
        else:
            print(text_of(now, rates), end="\n\n", flush=True)
        before, read_s, done = now, at, done + 1


def _read(client: VarClient, paths: Sequence[str]) -> dict[str, int]:
    return {path.removeprefix(_PREFIX): int(value) for path, value in client.get(*paths).items()}


def text_of(total: Counters, rates: Rates) -> str:
    """A line about the whole link, and a table of its ports; every number as `total (per second)`."""
    numbers = {name: f"{value} ({rates[name]:.1f}/s)" for name, value in total.items()}
    ports: dict[str, dict[str, str]] = {}
    whole = []
    for name, number in numbers.items():
        found = _PORT.fullmatch(name)
        if found:
            ports.setdefault(found[1], {})[found[2]] = number
        elif name != "connected":
            whole.append(f"{_words(name)} {number}")
    state = "connected" if total.get("connected") else "not connected"
    columns = list(dict.fromkeys(column for port in ports.values() for column in port))
    rows = [["port", *map(_words, columns)]]
    rows += [[number, *(port.get(column, "") for column in columns)] for number, port in sorted(ports.items())]
    return f"{state}; {', '.join(whole)}\n{table(rows)}"


def _words(name: str) -> str:
    return name.replace("_", " ")
