# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var about checkpoints: save, restore."""

from __future__ import annotations

import argparse

from ..checkpoint import read_checkpoint, tick_of, write_checkpoint
from ..errors import TwinError
from .answers import open_client, print_answer, status_text, without_ok
from .wire import VarError


def save(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        if chosen.remote:
            reply = client.save_to(chosen.file)
            tick, size = reply["tick"], reply["bytes"]
        else:
            checkpoint = client.save()
            tick, size = tick_of(checkpoint), len(checkpoint)
            try:
                write_checkpoint(chosen.file, checkpoint)
            except TwinError as error:
                raise VarError("bad_value", str(error)) from None
    print_answer(chosen, {"tick": tick, "bytes": size}, lambda: f"tick {tick}, {size} bytes: {chosen.file}")


def restore(chosen: argparse.Namespace) -> None:
    try:
        checkpoint = b"" if chosen.remote else read_checkpoint(chosen.file)
    except TwinError as error:
        raise VarError("bad_value", f"{chosen.file}: {error}") from None
    with open_client(chosen, changes=True) as client:
        if chosen.remote:
            reply = client.restore_from(chosen.file, chosen.ignore_source_hash)
        else:
            reply = client.restore(checkpoint, chosen.ignore_source_hash)
    print_answer(chosen, without_ok(reply), lambda: status_text(reply))
