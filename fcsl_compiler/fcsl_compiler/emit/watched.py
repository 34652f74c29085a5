# SPDX-License-Identifier: Apache-2.0
"""Makes code of requirements that act on the machine: what they read, and their effects."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..model import code
from ..model.c_names import c_name
from ..model.code import Binary, If, Literal, Member, Set, Statement
from ..model.machine import Effect, Machine, Watched
from ..model.types import I32, I64, U64
from .names import health, instance_member

_MACHINE = code.Deref(code.Name("m"))
_STEP = re.compile(r"(\w+)|\[(\d+)\]")


def copy_watched(machine: Machine, watched: Watched) -> Statement:
    """Copies a scalar of the machine to the input of the instance that reads it."""
    inputs = Member(_record(machine, watched.instance), "inputs")
    return Set(Member(inputs, c_name(watched.input)), _value(watched))


def _value(watched: Watched) -> code.Expr:
    place: code.Place = _MACHINE
    for name, index in _STEP.findall(watched.member):
        place = Member(place, name) if name else _element(place, int(index))
    if watched.element is not None:
        place = _element(place, watched.element)
    if watched.path == "machine.tick":  # it counts this one, too
        return code.Convert(I64, Binary("+", place, Literal(1, U64)))
    if watched.c_type == "uint8_t":
        return Binary("!=", place, Literal(0, code.U8))
    return code.Convert(I32, place) if watched.type == "i32" else place


def _element(place: code.Place, index: int) -> code.Element:
    return code.Element(place, code.Sum((), index))


def _record(machine: Machine, instance: int) -> Member:
    return Member(_MACHINE, instance_member(machine.instances[instance]))


def apply_effects(machine: Machine) -> Iterator[Statement]:
    """When all that act have been evaluated: a violated requirement worsens the health of its target, which is not stale."""
    for effect in machine.effects:
        if effect.target >= 0:
            yield If(_is_violated(machine, effect), (_worsen(machine, effect),))


def _is_violated(machine: Machine, effect: Effect) -> code.Expr:
    return Binary("==", _health(machine, effect.instance), health(1))


def _worsen(machine: Machine, effect: Effect) -> Statement:
    own = _health(machine, effect.target)
    return If(Binary("<", own, health(effect.health)), (Set(own, health(effect.health)),))


def _health(machine: Machine, instance: int) -> Member:
    return Member(Member(_record(machine, instance), "outputs"), "health")
