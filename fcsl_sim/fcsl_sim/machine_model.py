# SPDX-License-Identifier: Apache-2.0
"""A machine with one instance as a model: an algorithm in Python that is part of the plant, or a sensor."""

from __future__ import annotations

from pathlib import Path

from simclient.run import open_run

from .errors import SimError
from .models import FIELD_TYPES, ModelField, ModelTable, type_of

_ROLES = ("input", "output", "parameter", "state")


def machine_model(library: Path, name: str) -> ModelTable:
    """The model's table, as src/models/machine_model.c makes it: ports of the instance, without requests and health. Its
    parameters have the values of the machine JSON. Raises SimError and TwinError."""
    run = open_run(library, name)
    machine = run.machine
    run.close()
    if len(machine.instances) != 1:
        names = ", ".join(instance.name for instance in machine.instances)
        raise SimError(f"it has {len(machine.instances)} instances ({names}), and a model is one")
    fields = {}
    for field in machine.fields.values():
        if field.role in _ROLES and field.type in FIELD_TYPES and not field.connected_from:
            path = field.path.removeprefix(f"{field.instance}.")
            type_ = type_of(field.type, field.shape)
            fields[path] = ModelField(path, field.role, False, False, False, type_, field.offset, field.unit, field.doc)
    return ModelTable(name, library, 0, 0, False, True, False, False, "", (), fields, machine.tick_hz)
