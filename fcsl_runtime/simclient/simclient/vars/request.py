# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var that are a request of the same name without arguments: state, stats, pause, resume."""

from __future__ import annotations

import argparse

from .answers import open_client, print_answer, status_text, without_ok
from .show import flat, show_value, table


def request(chosen: argparse.Namespace) -> None:
    with open_client(chosen, changes=chosen.command in ("pause", "resume")) as client:
        reply = without_ok(getattr(client, chosen.command)())
    if chosen.command != "stats":
        print_answer(chosen, reply, lambda: status_text(reply))
        return
    rows = [row for name, value in reply.items() for row in flat(name, value)]
    # Histogram buckets are printed only with --json.
    print_answer(
        chosen, reply, lambda: table([[n, show_value(value)] for n, value in rows if not isinstance(value, list)])
    )
