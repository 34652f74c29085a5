# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var that read: list, get, eval, describe."""

from __future__ import annotations

import argparse
import json

from .answers import open_client, print_answer, units_of, without_ok
from .show import flat, jsonable, show_value, table, with_unit
from .wire import VarError


def list_fields(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        fields = client.describe_all(client.list(chosen.prefix))
    if not fields and not chosen.json:
        raise VarError("unknown_path", f"no path begins with '{chosen.prefix}'")
    print_answer(chosen, fields, lambda: table([[f["path"], f["type"], f["unit"], f["doc"]] for f in fields]))


def get(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        values = client.get(*chosen.paths)
        if chosen.json:
            print(json.dumps(jsonable(values)))
            return
        rows = [row for path, value in values.items() for row in flat(path, value)]
        units = units_of(client, [path for path, _ in rows])
    print(table([[path, with_unit(show_value(value), units[path])] for path, value in rows]))


def evaluate(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        value = client.eval(chosen.expression)
    print_answer(chosen, value, lambda: show_value(value))


def describe(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        described = without_ok(client.describe(chosen.path))
    print_answer(
        chosen,
        described,
        lambda: table([[name, show_value(value)] for name, value in described.items() if value not in ("", [])]),
    )
