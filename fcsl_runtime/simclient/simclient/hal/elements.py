# SPDX-License-Identifier: Apache-2.0
"""The elements of a plan's outputs: what a user names to move it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..board.plan import Device, Plan, Pulse
from ..errors import TwinError, did_you_mean

_ELEMENT = re.compile(r"(?P<channel>[^\[\]]+)(?:\[(?P<index>\d{1,5})\])?")


@dataclass(frozen=True)
class Element:
    """`name`: such as motors[0]."""

    name: str
    device: Device
    rule: Pulse


def find_element(plan: Plan, text: str) -> Element:
    """CHANNEL[INDEX]; CHANNEL is its first element. Raises TwinError."""
    matched = _ELEMENT.fullmatch(text)
    name = f"{matched['channel']}[{int(matched['index'] or 0)}]" if matched else text
    elements = {element.name: element for element in _elements(plan)}
    if name not in elements:
        has = ", ".join(elements) or "none"
        raise TwinError(f"the plan has no output `{name}`{did_you_mean(name, list(elements))}; it has {has}")
    return elements[name]


def find_elements(plan: Plan, texts: Sequence[str]) -> list[Element]:
    """Each once; CHANNEL alone is all its elements. Raises TwinError."""
    found: dict[str, Element] = {}
    for text in texts:
        whole = [element for element in _elements(plan) if element.name.rpartition("[")[0] == text]
        found |= {element.name: element for element in whole or [find_element(plan, text)]}
    return list(found.values())


def elements_of(plan: Plan, device: Device) -> list[Element]:
    """All that this device drives, whatever the plan calls it."""
    return [e for e in _elements(plan) if (e.device.driver, e.device.address) == (device.driver, device.address)]


def _elements(plan: Plan) -> list[Element]:
    return [Element(f"{o.channel}[{p.index}]", plan.devices[o.device], p) for o in plan.outputs for p in o.pulses]
