# SPDX-License-Identifier: Apache-2.0
"""The parameter file of gains (docs/reference/variables.md): what differs from the compiled values, by the runtime's writer."""

from __future__ import annotations

from dataclasses import replace

from ..campaign.flight import Flights
from ..native import Simulation

#: The section of a machine that is alone.
_EVERY_NODE = "/**:"
#: Of a machine with its compiled values.
_NOTHING = "ros__parameters: {}"


def parameter_file(flights: Flights, gains: tuple[float, ...]) -> str:
    """Of a simulation with several controllers: a section for each machine that has some. Raises SimError."""
    config, tuned = flights.study.config, flights.with_gains(gains)
    texts = []
    with (
        Simulation(replace(config.plan, parameters=None), config.tables) as compiled,
        Simulation(tuned, config.tables) as after,
    ):
        for number, machine in enumerate(config.machines.values()):
            text = after.changed_parameters(number, compiled)
            if len(config.machines) > 1:
                text = text.replace(_EVERY_NODE, f"{machine.name}:", 1)
            texts.append(text if _NOTHING not in text or len(config.machines) == 1 else "")
    return "".join(texts)
