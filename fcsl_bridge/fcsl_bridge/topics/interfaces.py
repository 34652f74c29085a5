# SPDX-License-Identifier: Apache-2.0
"""Generated message classes: imported by name, and compared with the machine's definitions."""

from __future__ import annotations

import importlib
import re
from typing import Any

from fcsl_compiler.api.files import read_json
from fcsl_compiler.api.packages import PackageNotFound, package_share
from simclient.descriptor import Instance

from ..errors import BridgeError

#: Line before the definition of a nested message.
_SECTION = re.compile(r"^={80}\nMSG: \w+/(\w+)\n", re.MULTILINE)
#: rosidl's Python name by primitive type of a .msg text.
_PYTHON_NAMES = {"bool": "boolean", "float32": "float", "float64": "double"}


def message_class(type_name: str) -> Any:
    """The Python class of `package/msg/Name`. Raises BridgeError."""
    package, _, name = type_name.split("/")
    try:
        module = importlib.import_module(f"{package}.msg")
    except ImportError as error:
        raise BridgeError(
            f"message {type_name}: package `{package}` has no ROS 2 messages in this environment ({error}); "
            f"source the workspace that has them (a machine's own package needs fcsl_generate_interfaces() to have any)"
        ) from None
    found = getattr(module, name, None)
    if found is None:
        raise BridgeError(f"message {type_name} does not exist in package `{package}`; build that package again")
    return found


def mapped_class(type_name: str, type_hash: str) -> Any:
    """The class of a message of mapped channels. Raises BridgeError if it is not installed with the definition that the
    machine was compiled with, because its bytes would be misread."""
    found = message_class(type_name)
    package, _, name = type_name.split("/")
    try:
        described = read_json(package_share(package) / "msg" / f"{name}.json")
        installed = next(t["hash_string"] for t in described["type_hashes"] if t["type_name"] == type_name)
    except (PackageNotFound, OSError, ValueError, LookupError, TypeError, StopIteration):
        raise BridgeError(
            f"message {type_name}: package `{package}` is installed without its type description; build it again"
        ) from None
    if installed != type_hash:
        raise BridgeError(
            f"message {type_name} is installed with another definition than the one that the machine was compiled with "
            f"({installed} instead of {type_hash}); compile the machine again, or source the other workspace"
        )
    return found


def instance_class(instance: Instance) -> Any:
    """The class of an instance's generated message. Raises BridgeError if it is not the one that the machine was
    compiled with, because its bytes would be misread."""
    found = message_class(instance.message_type)
    package = instance.message_type.split("/")[0]
    own, *structs = _SECTION.split(instance.message_text)
    expected = {instance.message_type: own}
    expected |= {f"{package}/msg/{name}": text for name, text in zip(structs[::2], structs[1::2], strict=True)}
    held = {name.rpartition("/")[2] for name in expected}
    for type_name, text in expected.items():
        fields = _declarations(text, package, held)
        if dict(message_class(type_name).get_fields_and_field_types()) != fields:
            raise BridgeError(
                f"message {type_name} of package `{package}` is not the one that instance `{instance.name}` "
                f"was compiled with; build library and messages from the same sources"
            )
    return found


def _declarations(text: str, package: str, held: set[str]) -> dict[str, str]:
    """Name to type of the fields of a .msg text, types in rosidl's Python spelling; without constants.

    `held` are the messages of `package` that the text may use.
    """
    fields = {}
    for line in text.splitlines():
        code = line.partition("#")[0].strip()
        if code and "=" not in code:
            type_name, name = code.split()
            base, bracket, extent = type_name.partition("[")
            base = f"{package}/{base}" if base in held else _PYTHON_NAMES.get(base, base)
            fields[name] = base + bracket + extent
    return fields
