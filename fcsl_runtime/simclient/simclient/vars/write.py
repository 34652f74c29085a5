# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var that change a machine: set, tick, set-state."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from .answers import open_client, print_answer, status_text, without_ok
from .value_text import read_value
from .wire import VarError

_TICKS_PER_REQUEST = 20_000


def set_values(chosen: argparse.Namespace) -> None:
    values = {path: read_value(value) for path, value in _assignments(chosen.values)}
    with open_client(chosen, changes=True) as client:
        reply = client.set(values, chosen.allow_non_finite)
    print_answer(chosen, without_ok(reply), lambda: status_text(reply))
    for path, writer in reply["overwritten_by"].items():
        print(f"fcsl var: note: {path} will be overwritten by {writer}", file=sys.stderr)


def _assignments(words: Sequence[str]) -> list[tuple[str, str]]:
    """`PATH=VALUE …`, or a single `PATH VALUE`."""
    if len(words) == 2 and "=" not in words[0] and "=" not in words[1]:
        return [(words[0].strip(), words[1].strip())]
    found = []
    for word in words:
        path, equals, value = word.partition("=")
        if not equals:
            raise VarError("bad_request", f"set takes PATH=VALUE, one or more times, or one PATH VALUE, not '{word}'")
        found.append((path.strip(), value.strip()))
    return found


def tick(chosen: argparse.Namespace) -> None:
    with open_client(chosen, changes=True) as client:
        left = chosen.count
        while left > 0:  # in portions that are answered within the timeout
            client.tick(min(left, _TICKS_PER_REQUEST))
            left -= _TICKS_PER_REQUEST
        reply = client.state()
    print_answer(chosen, without_ok(reply), lambda: status_text(reply))


def set_state(chosen: argparse.Namespace) -> None:
    with open_client(chosen, changes=True) as client:
        reply = without_ok(client.set_state(chosen.state))
    print_answer(chosen, reply, lambda: status_text(reply))
