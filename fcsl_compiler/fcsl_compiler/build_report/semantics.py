# SPDX-License-Identifier: Apache-2.0
"""What one x86-64 instruction does to what is known (values.py). What is not described here makes its target unknown.

Sound by construction: an instruction that this file does not know forgets every register it could write.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from .objects import Instruction, ObjectFile
from .values import CALLER_SAVED, NAMES, RSP, Flags, State, Value, decide, minus, number, part, plus, signed

Effect = Callable[[State], None]


def _registers() -> dict[str, tuple[int, int]]:
    """Number and bytes of every general register; those of bits 8 to 15 have size 0."""
    found: dict[str, tuple[int, int]] = {}
    for n, name in enumerate(NAMES):
        found[name] = (n, 8)
        if n < 8:
            low = name[1:]
            found |= {"e" + low: (n, 4), low: (n, 2), (low[0] + "l" if n < 4 else low + "l"): (n, 1)}
        else:
            found |= {name + "d": (n, 4), name + "w": (n, 2), name + "b": (n, 1)}
    return found | {h: (n, 0) for n, h in enumerate(("ah", "ch", "dh", "bh"))}


REGISTERS = _registers()
_SUFFIX = {"b": 1, "w": 2, "l": 4, "q": 8}
_MEMORY = re.compile(r"^(%[fg]s:)?(-?(?:0x)?[0-9a-f]+)?\((%\w+)?(?:,(%\w+),(\d))?(?:,(\d))?\)$")
#: Bytes that a store of a vector register writes; any other writes at most 32.
_VECTOR_STORES = {"movsd": 8, "movss": 4, "movlpd": 8, "movhpd": 8, "movlps": 8, "movhps": 8, "movd": 4, "movq": 8}
_VECTOR_STORES |= dict.fromkeys(("movaps", "movapd", "movups", "movupd", "movdqa", "movdqu", "movntps", "movntdq"), 16)
_CONDITIONS = "o no b ae e ne be a s ns p np l ge le g".split()
_ARITHMETIC = ("add", "sub", "and", "or", "xor", "cmp", "test", "shl", "shr", "sar", "ror", "rol", "imul", "adc", "sbb")
_UNARY = ("inc", "dec", "neg", "not")


class Decoder:
    """Effects of the instructions of one object. `stack_escapes`: an address in the frame may be in other hands."""

    def __init__(self, code: ObjectFile, stack_escapes: bool):
        self.code, self.stack_escapes = code, stack_escapes

    def effect(self, i: Instruction) -> Effect | None:
        """None: it changes nothing that is tracked."""
        name, size = self._split(i)
        method = _METHODS.get(name)
        if method is not None:
            return method(self, i, size)
        if i.mnemonic.startswith("set") and i.mnemonic[3:] in _CONDITIONS:
            return self._set(i)
        if i.mnemonic.startswith("cmov"):
            return self._cmov(i, size)
        if name in _ARITHMETIC and len(i.operands) >= 1:
            return self._arithmetic(i, name, size)
        if i.mnemonic.startswith(
            ("nop", "endbr", "prefetch", "data16", "vzero", "sfence", "lfence", "mfence", "pause")
        ):
            return None
        return self._unknown(i)

    def _split(self, i: Instruction) -> tuple[str, int]:
        """Name without the suffix of size, and bytes that it works on."""
        name = i.mnemonic
        known = [REGISTERS[o[1:]][1] for o in i.operands if o[1:] in REGISTERS]
        if name in _METHODS or name in _ARITHMETIC or name in _UNARY:
            return name, (known[-1] if known else 8) or 1
        if name[:-1] in _METHODS or name[:-1] in _ARITHMETIC or name[:-1] in _UNARY:
            return name[:-1], _SUFFIX.get(name[-1], 8)
        return name, (known[-1] if known else 8) or 1

    # ---- operands ------------------------------------------------------------------------------------------------

    def address(self, i: Instruction, operand: str) -> Callable[[State], Value] | None:
        """Of a memory operand; None when the operand is none."""
        m = _MEMORY.match(operand)
        if m is None:
            return None
        displacement = int(m[2], 0) if m[2] else 0
        if m[1]:
            return lambda s: None
        if m[3] == "%rip":
            target = self.code.address_of(i)
            # The distance counts from the end of the instruction, behind an immediate that may follow it.
            return lambda s: target
        base = REGISTERS[m[3][1:]] if m[3] else None
        index, scale = (REGISTERS.get(m[4][1:]) if m[4] else None), int(m[5] or 1)
        if base and base[1] != 8 or m[4] and (index is None or index[1] != 8):
            return lambda s: None
        if index is None and base is not None:
            n = base[0]

            def simple(s: State) -> Value:
                v = part(s.registers[n], 64)
                return v if not displacement or v is None else plus(v, ("", displacement & ((1 << 64) - 1)))

            return simple

        def whole(s: State) -> Value:
            at = part(s.registers[base[0]], 64) if base is not None else ("", 0)
            if index is not None:
                by = part(s.registers[index[0]], 64)
                if by is not None and by[0] == "":
                    by = number(by[1] * scale)
                elif scale != 1:
                    by = None
                at = plus(at, by)
            return plus(at, number(displacement))

        return whole

    def reader(self, i: Instruction, operand: str, size: int) -> Callable[[State], Value]:
        if operand.startswith("$"):
            constant = number(int(operand[1:], 0) & ((1 << size * 8) - 1)) if not i.symbol else None
            return lambda s: constant
        if operand[1:] in REGISTERS:
            n, own = REGISTERS[operand[1:]]
            if own == 0:
                return lambda s: None
            return lambda s: part(s.registers[n], own * 8)
        where = self.address(i, operand)
        if where is None:
            return lambda s: None
        return lambda s: self._load(s, where(s), size)

    def _load(self, s: State, address: Value, size: int) -> Value:
        found = s.load(address, size)
        if found is None and address is not None and size == 4 and (target := self.code.tables.get(address)):  # type: ignore[call-overload]
            return ((target[0], address), target[1])
        return found

    def writer(self, i: Instruction, operand: str, size: int) -> Callable[[State, Value], None]:
        if operand[1:] in REGISTERS:
            n, own = REGISTERS[operand[1:]]
            if own == 8:
                return lambda s, v: s.registers.__setitem__(n, None if v is not None and v[0] == "byte" else v)
            if own == 4:
                return lambda s, v: s.registers.__setitem__(n, part(v, 32))
            return lambda s, v: s.registers.__setitem__(n, _inserted(s.registers[n], v, own))
        where = self.address(i, operand)
        if where is None:
            return lambda s, v: None
        escapes = self.stack_escapes
        return lambda s, v: s.store(where(s), size, part(v, size * 8), escapes)

    # ---- groups --------------------------------------------------------------------------------------------------

    def _mov(self, i: Instruction, size: int) -> Effect | None:
        if len(i.operands) != 2 or any(o.startswith("%xmm") for o in i.operands):
            return self._unknown(i)
        read, write = self.reader(i, i.operands[0], size), self.writer(i, i.operands[1], size)
        return lambda s: write(s, read(s))

    def _movabs(self, i: Instruction, size: int) -> Effect | None:
        return self._mov(i, 8)

    def _extend(self, from_size: int, to_size: int, with_sign: bool) -> Callable[[Instruction], Effect]:
        def make(i: Instruction) -> Effect:
            read, write = self.reader(i, i.operands[0], from_size), self.writer(i, i.operands[1], to_size)

            def run(s: State) -> None:
                v = read(s)
                if v is not None and isinstance(v[0], tuple):
                    write_word(s, v)
                    return
                v = part(v, from_size * 8)
                write(s, number(signed(v[1], from_size * 8)) if v is not None and with_sign else v)

            n = REGISTERS.get(i.operands[1][1:], (0, 0))[0]

            def write_word(s: State, v: Value) -> None:
                s.registers[n] = v if with_sign and to_size == 8 else None

            return run

        return make

    def _lea(self, i: Instruction, size: int) -> Effect | None:
        where, write = self.address(i, i.operands[0]), self.writer(i, i.operands[1], size)
        return (lambda s: write(s, where(s))) if where else self._unknown(i)

    def _push(self, i: Instruction, size: int) -> Effect | None:
        read, escapes = self.reader(i, i.operands[0], 8), self.stack_escapes

        def run(s: State) -> None:
            value = read(s)
            s.registers[RSP] = plus(s.registers[RSP], number(-8))
            s.store(s.registers[RSP], 8, value, escapes)

        return run

    def _pop(self, i: Instruction, size: int) -> Effect | None:
        write = self.writer(i, i.operands[0], 8)

        def run(s: State) -> None:
            value = s.load(s.registers[RSP], 8)
            s.registers[RSP] = plus(s.registers[RSP], number(8))
            write(s, value)

        return run

    def _leave(self, i: Instruction, size: int) -> Effect | None:
        def run(s: State) -> None:
            frame = s.registers[5]
            s.registers[5] = s.load(frame, 8)
            s.registers[RSP] = plus(frame, number(8))

        return run

    def _arithmetic(self, i: Instruction, name: str, size: int) -> Effect | None:
        bits = size * 8
        if name == "imul" and len(i.operands) == 1:
            return self._wide(i, signed_operands=True, size=size)
        if len(i.operands) == 1:  # a shift by one
            operands = ("$1", i.operands[0], i.operands[0])
        elif len(i.operands) == 3:
            operands = (i.operands[0], i.operands[1], i.operands[2])
        else:
            operands = (i.operands[0], i.operands[1], i.operands[1])
        by, of, to = self.reader(i, operands[0], size), self.reader(i, operands[1], size), operands[2]
        if name in ("cmp", "test"):
            return lambda s: _compare(s, name, of(s), by(s), bits)
        write = self.writer(i, to, size)
        if name in ("xor", "sub", "sbb") and operands[0] == to and to.startswith("%"):
            if name == "sbb":
                return self._unknown(i)

            def zero(s: State) -> None:
                write(s, ("", 0))
                s.flags = Flags(("", 0), None, bits)

            return zero

        def run(s: State) -> None:
            a, b = of(s), by(s)
            result = _binary(name, a, b, bits)
            write(s, result)
            if name == "sub":
                s.flags = Flags(a, b, bits) if a is not None and b is not None else Flags(result, None, bits, True)
            elif name in ("and", "or", "xor"):
                s.flags = Flags(result, None, bits)
            else:
                s.flags = Flags(result, None, bits, True) if name in ("add", "imul") and name != "imul" else None

        return run

    def _unary(self, name: str) -> Callable[[Instruction, int], Effect]:
        def make(i: Instruction, size: int) -> Effect:
            read, write = self.reader(i, i.operands[-1], size), self.writer(i, i.operands[-1], size)

            def run(s: State) -> None:
                v = read(s)
                if name == "not":
                    write(s, number(~v[1] & ((1 << size * 8) - 1)) if v is not None and v[0] == "" else None)
                    return
                result = (
                    {"inc": plus, "dec": minus}[name](v, ("", 1), size * 8)
                    if name != "neg"
                    else minus(("", 0), v, size * 8)
                )
                write(s, result)
                s.flags = Flags(result, None, size * 8, True)

            return run

        return make

    def _wide(self, i: Instruction, signed_operands: bool, size: int) -> Effect:
        """rdx:rax = rax * operand."""
        read, bits = self.reader(i, i.operands[0], size), size * 8

        def run(s: State) -> None:
            a, b = part(s.registers[0], bits), part(read(s), bits)
            s.flags = None
            if size < 4 or a is None or b is None or a[0] != "" or b[0] != "":
                s.registers[0] = s.registers[2] = None
                return
            x, y = (signed(a[1], bits), signed(b[1], bits)) if signed_operands else (a[1], b[1])
            product, mask = x * y, (1 << bits) - 1
            s.registers[0], s.registers[2] = ("", product & mask), ("", product >> bits & mask)

        return run

    def _set(self, i: Instruction) -> Effect:
        condition, write = i.mnemonic[3:], self.writer(i, i.operands[0], 1)

        def run(s: State) -> None:
            known = decide(condition, s.flags)
            write(s, None if known is None else ("", int(known)))

        return run

    def _cmov(self, i: Instruction, size: int) -> Effect:
        condition = next((c for c in _CONDITIONS if i.mnemonic in (f"cmov{c}", f"cmov{c}l", f"cmov{c}q")), "?")
        read, write = self.reader(i, i.operands[0], size), self.writer(i, i.operands[1], size)
        old = self.reader(i, i.operands[1], size)

        def run(s: State) -> None:
            known, new, before = decide(condition, s.flags), read(s), old(s)
            write(s, (new if known else before) if known is not None else (new if new == before else None))

        return run

    def _unknown(self, i: Instruction) -> Effect | None:
        """Forgets what it could change: its last operand and the flags, or every register where that is not so plain."""
        target, escapes = (i.operands[-1] if i.operands else ""), self.stack_escapes
        if target.startswith(("%xmm", "%ymm")):
            return _forget_flags if "comis" in i.mnemonic or i.mnemonic.startswith(("ptest", "vptest")) else None
        if target[1:] in REGISTERS and len(i.operands) >= 2 and not i.mnemonic.startswith(("xchg", "xadd", "cmpxchg")):
            n = REGISTERS[target[1:]][0]

            def forget(s: State) -> None:
                s.registers[n] = None
                s.flags = None

            return forget
        where = self.address(i, target)
        if where is not None and i.operands[0].startswith(("%xmm", "%ymm")):
            at, size = where, _VECTOR_STORES.get(i.mnemonic, 32)
            return lambda s: s.store(at(s), size, None, escapes)

        def all_of_it(s: State) -> None:
            stack = s.registers[RSP]
            s.registers, s.flags = [None] * 16, None
            s.registers[RSP] = stack
            s.forget(stack_too=True)

        return all_of_it


def after_call(s: State, stack_escapes: bool, clobbered: frozenset[int] = CALLER_SAVED) -> None:
    """What a called function may have changed."""
    for n in clobbered:
        s.registers[n] = None
    s.flags = None
    s.forget(stack_escapes)


def _forget_flags(s: State) -> None:
    s.flags = None


def _inserted(old: Value, new: Value, size: int) -> Value:
    """A register of which the lowest one or two bytes were written."""
    v = part(new, size * 8)
    above = ~((1 << size * 8) - 1)
    whole = old is not None and (old[0] == "" or old[0] == "low" and size == 1)
    if old is not None and whole:
        if v is not None:
            return ("", old[1] & above | v[1])
        return ("low", old[1] & above) if size == 1 else None
    return ("byte", v[1]) if size == 1 and v is not None else None


def _compare(s: State, name: str, left: Value, right: Value, bits: int) -> None:
    if name == "cmp":
        s.flags = Flags(left, right, bits) if left is not None and right is not None else None
    else:
        s.flags = Flags(_binary("and", left, right, bits), None, bits)


def _binary(name: str, a: Value, b: Value, bits: int) -> Value:
    """a (the target) with b."""
    if name == "add":
        return plus(a, b, bits)
    if name == "sub":
        return minus(a, b, bits)
    if name == "and" and ("", 0) in (a, b):
        return ("", 0)
    if a is None or b is None or a[0] != "" or b[0] != "":
        return a if name in ("and", "or") and a == b else None
    x, y, mask = a[1], b[1], (1 << bits) - 1
    count = y & (63 if bits == 64 else 31)
    if name in ("shl", "shr"):
        return ("", (x << count if name == "shl" else x >> count) & mask)
    if name == "sar":
        return ("", signed(x, bits) >> count & mask)
    if name in ("ror", "rol"):
        count = count % bits if name == "ror" else -count % bits
        return ("", (x >> count | x << (bits - count)) & mask)
    if name == "imul":
        return ("", signed(x, bits) * signed(y, bits) & mask)
    if name in ("and", "or", "xor"):
        return ("", {"and": x & y, "or": x | y, "xor": x ^ y}[name] & mask)
    return None


def _division(s: State) -> None:
    s.registers[0] = s.registers[2] = s.flags = None


def _repeated_store(d: Decoder, i: Instruction, size: int) -> Effect:
    escapes = d.stack_escapes

    def run(s: State) -> None:
        s.registers[1], s.registers[7] = ("", 0), None
        if "movs" in i.mnemonic:
            s.registers[6] = None
        s.forget(escapes)

    return run


def _extension(from_size: int, to_size: int, with_sign: bool) -> Callable[[Decoder, Instruction, int], Effect | None]:
    return lambda d, i, size: d._extend(from_size, to_size, with_sign)(i)


def _widened(register: int, bits: int) -> Callable[[Decoder, Instruction, int], Effect | None]:
    """cltq: rax from eax. cqto, cltd: rdx from the sign of rax."""

    def run(s: State) -> None:
        v = part(s.registers[0], bits)
        known = signed(v[1], bits) if v is not None and v[0] == "" else None
        s.registers[register] = None if known is None else number(known if register == 0 else (-1 if known < 0 else 0))
        if bits == 32 and register == 2:
            s.registers[2] = part(s.registers[2], 32)

    return lambda d, i, size: run


_METHODS: dict[str, Callable[[Decoder, Instruction, int], Effect | None]] = {
    "mov": Decoder._mov,
    "movabs": Decoder._movabs,
    "lea": Decoder._lea,
    "push": Decoder._push,
    "pop": Decoder._pop,
    "leave": Decoder._leave,
    "mul": lambda d, i, size: d._wide(i, signed_operands=False, size=size),
    "div": lambda d, i, size: _division,
    "idiv": lambda d, i, size: _division,
    "rep stos": _repeated_store,
    "rep movs": _repeated_store,
    "rep movsq": _repeated_store,
    "rep movsl": _repeated_store,
    "rep movsb": _repeated_store,
    "cltq": _widened(0, 32),
    "cqto": _widened(2, 64),
    "cltd": _widened(2, 32),
    "xchg": lambda d, i, size: None if len(set(i.operands)) == 1 else d._unknown(i),
    **{name: (lambda d, i, size, name=name: d._unary(name)(i, size)) for name in _UNARY},
    **{
        f"mov{sign}{a}{b}": _extension(_SUFFIX[a], _SUFFIX[b], sign == "s")
        for sign in "sz"
        for a, b in ("bw", "bl", "bq", "wl", "wq", "lq")
        if (sign, a) != ("z", "l")
    },
}
