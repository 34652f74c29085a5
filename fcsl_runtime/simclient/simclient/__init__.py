# SPDX-License-Identifier: Apache-2.0
"""Steps, records, replays and shows FCSL machines from Python.

`from simclient import AlgTwin` needs the standard library only. Modules with other dependencies are imported on first
use. Each of these packages imports only those above it:

    ros     messages as bytes, and plans of what goes from a message to a machine and back
    bag     bags of any format: `simclient.bag.Bag`, and the command `fcsl bag`
    view    pictures and 3D scenes of a run; the commands are `fcsl plot` and `fcsl rerun`
    replay  runs machines on bags: `fcsl replay`
    vars    the variable server's clients, fcsl var
    twin    AlgTwin, PyTwin, ProcessTwin, and the pytest plugin; SimTwin is in fcsl_sim
    telemetry  Telemetry, the receiver of UDP telemetry from flight programs and simulators
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .descriptor import Channel, FaultPlace, Field, Instance, Machine, Transition
    from .errors import BagError, MapError, OverwrittenWarning, TwinError
    from .events import Event
    from .requirements import not_exercised
    from .telemetry.receiver import Telemetry
    from .twin.alg_twin import AlgTwin, PyTwin
    from .twin.process_twin import ProcessTwin
    from .twin.search import find_violation
    from .twin.snapshot import diff
    from .twin.twin import Twin
    from .vars.client import VarClient
    from .vars.wire import VarError

#: Where each name is. It is imported on first use: a command that talks to a socket needs no twin.
_HOME = {
    "AlgTwin": "twin.alg_twin",
    "BagError": "errors",
    "Channel": "descriptor",
    "Event": "events",
    "FaultPlace": "descriptor",
    "Field": "descriptor",
    "Instance": "descriptor",
    "Machine": "descriptor",
    "MapError": "errors",
    "OverwrittenWarning": "errors",
    "ProcessTwin": "twin.process_twin",
    "PyTwin": "twin.alg_twin",
    "Telemetry": "telemetry.receiver",
    "Transition": "descriptor",
    "Twin": "twin.twin",
    "TwinError": "errors",
    "VarClient": "vars.client",
    "VarError": "vars.wire",
    "diff": "twin.snapshot",
    "find_violation": "twin.search",
    "not_exercised": "requirements",
}

__all__ = [
    "AlgTwin",
    "BagError",
    "Channel",
    "Event",
    "FaultPlace",
    "Field",
    "Instance",
    "Machine",
    "MapError",
    "OverwrittenWarning",
    "ProcessTwin",
    "PyTwin",
    "Telemetry",
    "Transition",
    "Twin",
    "TwinError",
    "VarClient",
    "VarError",
    "diff",
    "find_violation",
    "not_exercised",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        found = getattr(import_module(f".{_HOME[name]}", __name__), name)
    elif name == "SimTwin":
        from .simulation import simulation_part

        found = getattr(simulation_part("twin", name), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
