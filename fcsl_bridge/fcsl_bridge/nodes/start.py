# SPDX-License-Identifier: Apache-2.0
"""Entry points of the executables.

A node's modules take half a second to import. SIGINT meanwhile ends the process silently, without a traceback; from
run_node() on the node handles it.
"""

from __future__ import annotations

import importlib
import signal


def controller_node() -> None:
    _start("controller_node")


def diagnostics_node() -> None:
    _start("diagnostics_node")


def rerun_node() -> None:
    _start("rerun_node")


def sim_node() -> None:
    _start("sim_node")


def topic_count() -> None:
    _start("topic_count")


def _start(module: str) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    importlib.import_module(f".{module}", __package__).main()
