# SPDX-License-Identifier: Apache-2.0
"""Feeds the reader of telemetry's configurations what libFuzzer (atheris) invents.

What it reads must be all of the bytes and nothing else, lay the channels out without gaps, and be of use: every channel of
a packet can be read.
"""

from __future__ import annotations

import atheris
from must_hold import demand, search

from simclient.twin import trace  # noqa: F401 -- before what is instrumented

with atheris.instrument_imports(include=["simclient.telemetry"]):
    from simclient.telemetry.configuration import Configuration, read_configuration
    from simclient.telemetry.ring import Ring
    from simclient.telemetry.window import Window

_PACKET_BYTES_MAX = 100_000


def text_bytes(text: str) -> int:
    return 2 + len(text.encode())


def told_bytes(known: Configuration) -> int:
    """Of a configuration that says this and nothing else, by docs/guide/monitoring.md."""
    machine = known.machine
    total = 4 + 8 + 4 + 8 + 4 + text_bytes(machine.source_hash) + text_bytes(machine.name)
    total += text_bytes(machine.views) + 4
    for path, channel in known.channels.items():
        total += text_bytes(path) + 1 + 1 + 4 * len(channel.shape) + text_bytes(channel.unit)
        total += 2 + sum(map(text_bytes, channel.labels))
    return total


def check(body: bytes) -> None:
    known = read_configuration(body)
    if known is None:
        return
    demand(told_bytes(known) == len(body), "every byte is understood")
    at = 24
    for field in known.machine.fields.values():
        demand(field.offset == at, "channels lie one behind another")
        at += field.size
    demand(at == known.body_bytes <= 16 << 20, "channels fill a packet")
    demand(known.period_s > 0, "packets come at a rate")
    if at <= _PACKET_BYTES_MAX:
        ring = Ring(2, at)
        ring.put(0, bytes(at))
        window = Window(known, ring, 1, ring.held(), ())
        for field in window.fields:
            demand(window[field.path].shape == (1, *field.shape), "every channel can be read")


if __name__ == "__main__":
    search(check)
