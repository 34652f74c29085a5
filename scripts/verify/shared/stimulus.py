# SPDX-License-Identifier: Apache-2.0
"""What stimulus.h says, in Python, for a machine that CPython runs: the same writes before every tick, the same hash.

The two files stand side by side, function by function; the check `bits` finds out when they differ.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

BLOCK, WILD_FROM, LEVEL, DROPOUT, LEVEL_BITS, EXPONENT_LOW = 256, 192, 64, 16, 6, -6
VALUE, AROUND, WHETHER, STATE, FAULT, OVERRUN, SAMPLE, DROP, HARDWARE = range(1, 10)
GPIO, ADC, REGISTER = range(1, 4)
_MASK = 2**64 - 1
_STEP = 0x9E3779B97F4A7C15
_NO_OFFSET = 2**32 - 1

#: fcsl_type_t
_BOOL, _I32, _I64, _U32, _U64, _F32, _F64, _REQUEST, _HEALTH, _STATE = range(10)
#: Unsigned words of the scalar types, as struct formats.
_WORDS = {_BOOL: "B", _I64: "Q", _U64: "Q", _F64: "Q"}
#: fcsl_role_t
_INPUT, _OUTPUT, _PARAMETER, _ROLE_STATE = 1, 2, 3, 4
_WRITABLE, _SENSOR = 1, 0


def scramble(x: int) -> int:
    """splitmix64's output function."""
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9 & _MASK
    x = (x ^ (x >> 27)) * 0x94D049BB133111EB & _MASK
    return x ^ (x >> 31)


def draw(seed: int, tick: int, what: int, item: int, element: int) -> int:
    """Any 64 bits, the same for the same counters."""
    x = scramble((seed + _STEP * (tick + 1)) & _MASK)
    return scramble(((x ^ (what << 56) ^ (item << 28)) + _STEP * (element + 1)) & _MASK)


@dataclass(frozen=True)
class Format:
    """A binary floating-point format; infinity as bits."""

    mantissa: int
    bias: int
    infinity: int

    @property
    def sign(self) -> int:
        return self.infinity + (1 << self.mantissa)


_BINARY = {_F32: Format(23, 127, 0x7F800000), _F64: Format(52, 1023, 0x7FF0000000000000)}


def moderate(f: Format, level: int, around: int) -> int:
    """Sign, exponent and the first bits of the mantissa come from `level`, the others from `around`."""
    exponent = f.bias + (level >> 1 & 15) + EXPONENT_LOW
    mask = (1 << f.mantissa) - 1
    high = (level >> 5) << (f.mantissa - LEVEL_BITS) & mask
    return (f.sign if level & 1 else 0) | exponent << f.mantissa | high | around & mask >> LEVEL_BITS


def special(f: Format, r: int) -> int:
    """Zero, the least, a subnormal, the largest, infinity, NaN, one, or any bits; of either sign."""
    mantissa, any_ = (1 << f.mantissa) - 1, scramble(r)
    found = (
        0,
        1,
        any_ & mantissa,
        f.infinity - 1,
        f.infinity,
        f.infinity | (mantissa + 1) >> 1,
        f.bias << f.mantissa,
        any_ & (f.sign - 1),
    )
    return found[r >> 1 & 7] ^ (f.sign if r & 1 else 0)


def key_of(f: Format, bits: int) -> int:
    """Floats as integers in the same order."""
    return -(bits - f.sign) - 1 if bits >= f.sign else bits


def of_key(f: Format, key: int) -> int:
    """The float of a key, as bits."""
    return f.sign - key - 1 if key < 0 else key


def between(low: int, high: int, wanted: int, r: int) -> int:
    """`wanted` where it lies in [low, high], else something that does."""
    return wanted if low <= wanted <= high else low + r % (high - low + 1)


def canonical(f: Format, bits: int) -> int:
    """Every NaN is one."""
    return f.infinity | 1 << (f.mantissa - 1) if bits & (f.sign - 1) > f.infinity else bits


def mix(hash_: int, word: int) -> int:
    """`hash_` continued by one word."""
    x = (hash_ ^ word) * 0x9FB21C651E98DF25 & _MASK
    return (x ^ (x >> 29)) + 1 & _MASK


class _Field:
    """One field: how often it is written, and with what."""

    def __init__(self, descriptor: Any, index: int, sensors: set[int]):
        f = descriptor.fields[index]
        self.index, self.type, self.count, self.offset, self.path = index, f.type, f.count, f.offset, f.path.decode()
        self.role = f.role if f.flags & _WRITABLE and index not in sensors else None
        self.word = _WORDS.get(f.type, "I")
        self.write = struct.Struct(f"={f.count}{self.word}").pack_into
        self.enumerators = {_REQUEST: descriptor.request_count + 1, _HEALTH: 4, _STATE: descriptor.state_count}.get(
            f.type
        )
        self.format = _BINARY.get(f.type)
        self.bounds = self._float_bounds(f) if self.format else self._integer_bounds(f)

    def _float_bounds(self, f: Any) -> tuple[int, int] | None:
        """Keys of the least and the largest number that a host may write; None where nothing bounds it."""
        form = self.format
        assert form is not None
        code, word = ("f", "I") if self.type == _F32 else ("d", "Q")
        low, high = (
            key_of(form, struct.unpack(f"={word}", struct.pack(f"={code}", v))[0]) for v in (f.minimum, f.maximum)
        )
        if low < -form.infinity and high == form.infinity:
            return None
        return max(low, -form.infinity), min(high, form.infinity - 1)

    def _integer_bounds(self, f: Any) -> tuple[int, int]:
        least, most = {
            _I32: (-(2**31), 2**31 - 1),
            _U32: (0, 2**32 - 1),
        }.get(self.type, (-(2**63), 2**63 - 1))
        return int(f.minimum) if f.minimum > -(2**53) else least, int(f.maximum) if f.maximum < 2**53 else most

    def rate(self, tick: int) -> int:
        """In how many ticks of 256 it is written."""
        if self.role == _INPUT:
            return 240
        if self.role == _OUTPUT:
            return 64
        if self.role == _PARAMETER:
            return 4 if tick // BLOCK % 2 else 0
        return 4 if self.role == _ROLE_STATE and tick % BLOCK >= WILD_FROM else 0

    def value(self, level: int, r: int, wild: bool) -> int:
        """One scalar as an unsigned word."""
        if self.type == _BOOL:
            return r & 1
        if self.enumerators is not None:
            return r % self.enumerators
        if self.format is None:
            return self._integer(r)
        bits = special(self.format, r) if wild and r >> 61 == 0 else moderate(self.format, level, r)
        if self.bounds is None:
            return bits
        return of_key(self.format, between(*self.bounds, key_of(self.format, bits), r))

    def _integer(self, r: int) -> int:
        assert self.bounds is not None
        any_ = scramble(r)
        signed = (any_ ^ 2**63) - 2**63
        wanted = (r >> 1 & 15) - 4 if r & 1 else signed >> (31 if self.word == "I" else 0)
        return between(*self.bounds, wanted, any_) % 2 ** (32 if self.word == "I" else 64)


class Stimulus:
    """`descriptor` is the machine's (fcsl_machine_t in ctypes), `init` and `force_state` are what runs the machine."""

    def __init__(self, descriptor: Any, seed: int, init: Callable[[Any], int], force_state: Callable[[Any, int], None]):
        self.seed, self._init, self._force_state = seed, init, force_state
        self._states, self._tick_offset = descriptor.state_count, descriptor.tick_offset
        channels = [descriptor.channels[i] for i in range(descriptor.channel_count)]
        self._channels = [(i, c) for i, c in enumerate(channels) if c.direction == _SENSOR]
        sensors = {c.field for _, c in self._channels}
        self.fields = [_Field(descriptor, i, sensors) for i in range(descriptor.field_count)]
        self._written = [f for f in self.fields if f.role is not None]
        self._instances = [descriptor.instances[i] for i in range(descriptor.instance_count)]
        self._words = self._all_words(descriptor.size)
        self._order = self._in_table_order()

    def _all_words(self, size: int) -> struct.Struct:
        """Unpacks every field of the machine's memory as unsigned words, in the order of their offsets."""
        text, at = "=", 0
        for f in sorted(self.fields, key=lambda f: f.offset):
            text += f"{f.offset - at}x{f.count}{f.word}"
            at = f.offset + struct.calcsize(f"={f.count}{f.word}")
        return struct.Struct(text + f"{size - at}x")

    def _in_table_order(self) -> list[tuple[int, Format | None]]:
        """For every scalar, in the order of the field table: which word it is, and its format if it is a float."""
        first, at = {}, 0
        for f in sorted(self.fields, key=lambda f: f.offset):
            first[f.index] = at
            at += f.count
        return [(first[f.index] + i, f.format) for f in self.fields for i in range(f.count)]

    def begin(self, memory: Any) -> None:
        """Attaches every sensor channel."""
        for _, channel in self._channels:
            memory[channel.attached_offset] = 1

    def tick(self, memory: Any, tick: int) -> None:
        """Before each step: writes what a host may write."""
        if tick > 0 and tick % BLOCK == 0:
            self._init(memory)
            self.begin(memory)
            struct.pack_into("=Q", memory, self._tick_offset, 0 if tick // BLOCK % 2 else tick)
        self._choose_state(memory, tick)
        for field in self._written:
            often = field.rate(tick)
            if often and draw(self.seed, tick, WHETHER, field.index, 0) % 256 < often:
                self._write(memory, field, tick)
        for index, channel in self._channels:
            self._sample(memory, index, channel, tick)
        if tick % BLOCK >= WILD_FROM:
            self._inject(memory, tick)

    def _write(self, memory: Any, field: _Field, tick: int) -> None:
        wild = tick % BLOCK >= WILD_FROM
        values = [
            field.value(
                draw(self.seed, tick // LEVEL, VALUE, field.index, i),
                draw(self.seed, tick, AROUND, field.index, i),
                wild,
            )
            for i in range(field.count)
        ]
        field.write(memory, field.offset, *values)

    def _choose_state(self, memory: Any, tick: int) -> None:
        if tick % 16 == 8 and tick // LEVEL % 2:
            self._force_state(memory, draw(self.seed, tick, STATE, 0, 0) % self._states)

    def _sample(self, memory: Any, index: int, channel: Any, tick: int) -> None:
        r = draw(self.seed, tick, SAMPLE, index, 0)
        if draw(self.seed, tick // DROPOUT, DROP, index, 0) % 16 == 0 or r % 16 == 0:
            return
        self._write(memory, self.fields[channel.field], tick)
        memory[channel.fresh_offset] = 1
        struct.pack_into("=I", memory, channel.sample_age_offset, (r >> 8) % 16 if (r >> 4) % 8 == 0 else 0)
        struct.pack_into("=Q", memory, channel.stamp_offset, r >> 1 if (r >> 7) % 2 == 0 else 0)

    def _inject(self, memory: Any, tick: int) -> None:
        for i, instance in enumerate(self._instances):
            r = draw(self.seed, tick, FAULT, i, 0)
            if instance.inject_fault_offset != _NO_OFFSET and r % 8 == 0:
                memory[instance.inject_fault_offset] = 1 + (r >> 3) % 3  # a fault, or degraded or failed at least
            if instance.inject_overrun_offset != _NO_OFFSET and draw(self.seed, tick, OVERRUN, i, 0) % 8 == 0:
                memory[instance.inject_overrun_offset] = 1

    def words(self, memory: Any) -> list[int]:
        """Every scalar of every field as the hash takes it: zero-extended, NaNs canonical."""
        found = self._words.unpack_from(memory)
        return [found[i] if f is None else canonical(f, found[i]) for i, f in self._order]

    def hash(self, memory: Any, hash_: int) -> int:
        """`hash_` (0 to begin) continued by every field."""
        for word in self.words(memory):
            hash_ = mix(hash_, word)
        return hash_


class StimulusHost:
    """Hardware and clock as functions of seed, tick and pin; for fcsl_compiler.reference.machine.Host."""

    def __init__(self, seed: int):
        self.seed, self.tick, self.written = seed, 0, 0
        self.hardware: dict[str, Callable[..., Any]] = {
            "hw_read_gpio": lambda pin: self._read(GPIO, pin, lambda r: bool(r & 1)),
            "hw_write_gpio": lambda pin, level: self._write(GPIO, pin, int(level)),
            "hw_read_adc": lambda channel: self._read(ADC, channel, self._word),
            "hw_read_u32": lambda address: self._read(REGISTER, address, self._word),
            "hw_write_u32": lambda address, value: self._write(REGISTER, address, int(value)),
        }

    def clock_ns(self) -> int:
        """Stands still within a tick."""
        return self.tick * 1000

    @staticmethod
    def _word(r: int) -> int:
        """12 bits, as of a converter, or any 32."""
        return r >> 1 & 0xFFF if r & 1 else scramble(r) & 0xFFFFFFFF

    def _read(self, kind: int, number: int, value: Callable[[int], Any]) -> Any:
        r = draw(self.seed, self.tick, HARDWARE, kind, int(number))
        return None if r >> 60 == 0 else value(r)

    def _write(self, kind: int, number: int, word: int) -> None:
        self.written = mix(mix(self.written, kind << 32 | int(number)), word)
