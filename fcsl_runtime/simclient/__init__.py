# SPDX-License-Identifier: Apache-2.0
"""Steps, records, replays and shows FCSL machines from Python.

`from simclient import AlgTwin` needs the standard library only; reading bags, replay and pictures are in modules of
their own (simclient.bag, .digest, .replay, .to_rerun, .plot), which import what they need.
"""

from .alg_twin import AlgTwin, PyTwin
from .descriptor import Channel, Field, Instance, Machine, Transition
from .errors import BagError, MapError, TwinError
from .snapshot import diff
from .twin import Twin

__all__ = [
    "AlgTwin",
    "BagError",
    "Channel",
    "Field",
    "Instance",
    "Machine",
    "MapError",
    "PyTwin",
    "Transition",
    "Twin",
    "TwinError",
    "diff",
]
