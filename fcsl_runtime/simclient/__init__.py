# SPDX-License-Identifier: Apache-2.0
"""Steps, records, replays and shows FCSL machines from Python.

`from simclient import AlgTwin` needs the standard library only; reading bags, replay and pictures are in modules of
their own (simclient.bag, .digest, .replay, .to_rerun, .plot), which import what they need.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .alg_twin import AlgTwin, PyTwin
from .descriptor import Channel, Field, Instance, Machine, Transition
from .errors import BagError, MapError, TwinError
from .snapshot import diff
from .twin import Twin

if TYPE_CHECKING:
    from .process_twin import ProcessTwin
    from .var_client import VarClient
    from .var_wire import VarError

#: What is imported when it is asked for: sockets and processes are not everybody's.
_LATER = {"ProcessTwin": "process_twin", "VarClient": "var_client", "VarError": "var_wire"}

__all__ = [
    "AlgTwin",
    "BagError",
    "Channel",
    "Field",
    "Instance",
    "Machine",
    "MapError",
    "ProcessTwin",
    "PyTwin",
    "Transition",
    "Twin",
    "TwinError",
    "VarClient",
    "VarError",
    "diff",
]


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(f".{_LATER[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
