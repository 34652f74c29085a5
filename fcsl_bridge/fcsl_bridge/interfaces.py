# SPDX-License-Identifier: Apache-2.0
"""Generated message classes: imported by name, and compared with what the machine says they are."""

from __future__ import annotations

import importlib
from typing import Any

from simclient.descriptor import Instance

from .errors import BridgeError

#: How rosidl's Python names a primitive of a .msg text.
_PYTHON_NAMES = {"bool": "boolean", "float32": "float", "float64": "double"}


def message_class(type_name: str) -> Any:
    """The Python class of `package/msg/Name`. Raises BridgeError."""
    package, _, name = type_name.split("/")
    try:
        module = importlib.import_module(f"{package}.msg")
    except ImportError as error:
        raise BridgeError(
            f"message {type_name}: package `{package}` has no ROS 2 messages in this environment ({error}); its "
            f"CMakeLists.txt needs fcsl_generate_interfaces(), and its workspace must be built and sourced"
        ) from None
    found = getattr(module, name, None)
    if found is None:
        raise BridgeError(f"message {type_name} does not exist in package `{package}`; build that package again")
    return found


def instance_class(instance: Instance) -> Any:
    """The class of an instance's generated message. Raises BridgeError when it is not what the machine was compiled with:
    its bytes would be read as something else."""
    found = message_class(instance.message_type)
    expected = _declarations(instance.message_text)
    if dict(found.get_fields_and_field_types()) != expected:
        package = instance.message_type.split("/")[0]
        raise BridgeError(
            f"message {instance.message_type} of package `{package}` is not the one that instance `{instance.name}` "
            f"was compiled with; build library and messages from the same sources"
        )
    return found


def _declarations(text: str) -> dict[str, str]:
    """Name to type of the fields of a .msg text, types as rosidl's Python spells them; constants left out."""
    fields = {}
    for line in text.splitlines():
        code = line.partition("#")[0].strip()
        if code and "=" not in code:
            type_name, name = code.split()
            base, bracket, extent = type_name.partition("[")
            fields[name] = _PYTHON_NAMES.get(base, base) + bracket + extent
    return fields
