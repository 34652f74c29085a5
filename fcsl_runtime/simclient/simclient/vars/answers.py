# SPDX-License-Identifier: Apache-2.0
"""What the commands of fcsl var share: the machine that they talk to, and how they print what it says."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

from .client import VarClient
from .find import VARIABLE, find_server, named_address
from .show import jsonable
from .wire import VarError


def open_client(chosen: argparse.Namespace, changes: bool = False) -> VarClient:
    """Of a machine that the user did not name, says which one it is; such a machine is read, and not changed."""
    address = named_address(chosen.socket)
    if address is None:
        server = find_server()
        if changes:
            raise VarError(
                "unnamed",
                f"which machine? {server} runs; name it with --socket or {VARIABLE}, since this command changes it",
            )
        print(f"fcsl var: {server}", file=sys.stderr)
        address = server.address
    return VarClient(address, chosen.token)


def print_answer(chosen: argparse.Namespace, value: Any, text: Callable[[], str]) -> None:
    print(json.dumps(jsonable(value)) if chosen.json else text())


def status_text(reply: dict[str, Any]) -> str:
    state = reply.get("state", "")
    change = f" → {reply['next_state']}" if reply.get("next_state", state) != state else ""
    return f"tick {reply['tick']}  {state}{change}{'  paused' if reply['paused'] else ''}"


def without_ok(reply: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in reply.items() if name not in ("ok", "id")}


def units_of(client: VarClient, paths: Sequence[str]) -> dict[str, str]:
    """The unit of each path."""
    return {path: described["unit"] for path, described in zip(paths, client.describe_all(paths), strict=True)}
