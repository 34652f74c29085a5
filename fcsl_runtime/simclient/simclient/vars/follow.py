# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var that follow a machine: watch, plot."""

from __future__ import annotations

import argparse

from .answers import open_client
from .watch import plot, watch


def watch_values(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        try:
            watch(client, chosen.paths, chosen.every, chosen.ticks, chosen.json)
        except KeyboardInterrupt:
            pass  # the normal end


def plot_values(chosen: argparse.Namespace) -> None:
    with open_client(chosen) as client:
        try:
            plot(client, chosen.paths, chosen.every, chosen.ticks, chosen.window)
        except KeyboardInterrupt:
            pass
