# SPDX-License-Identifier: Apache-2.0
"""Effect of one x86-64 instruction on known values (values.py). An instruction that is not described makes its target
unknown.

The analysis is sound: an unknown instruction makes every register unknown that it could write.
"""

from __future__ import annotations

from collections.abc import Callable

from .arithmetic import binary
from .effects import Effect, compare, division, escaping, forget_flags
from .objects import Instruction
from .operands import REGISTERS, Operands
from .values import RSP, Flags, State, Value, decide, minus, number, part, plus, signed

_SUFFIX = {"b": 1, "w": 2, "l": 4, "q": 8}
#: Bytes that a store of a vector register writes. Other stores write at most 32.
_VECTOR_STORES = {"movsd": 8, "movss": 4, "movlpd": 8, "movhpd": 8, "movlps": 8, "movhps": 8, "movd": 4, "movq": 8}
_VECTOR_STORES |= dict.fromkeys(("movaps", "movapd", "movups", "movupd", "movdqa", "movdqu", "movntps", "movntdq"), 16)
_CONDITIONS = "o no b ae e ne be a s ns p np l ge le g".split()
_ARITHMETIC = ("add", "sub", "and", "or", "xor", "cmp", "test", "shl", "shr", "sar", "ror", "rol", "imul", "adc", "sbb")
_UNARY = ("inc", "dec", "neg", "not")


class Decoder(Operands):
    """Decodes the effects of the instructions of one object."""

    def effect(self, i: Instruction) -> Effect | None:
        """Effect of an instruction. None if it changes nothing that is tracked."""
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
        """Mnemonic without the size suffix, and operand size in bytes."""
        name = i.mnemonic
        known = [REGISTERS[o[1:]][1] for o in i.operands if o[1:] in REGISTERS]
        if name in _METHODS or name in _ARITHMETIC or name in _UNARY:
            return name, (known[-1] if known else 8) or 1
        if name[:-1] in _METHODS or name[:-1] in _ARITHMETIC or name[:-1] in _UNARY:
            return name[:-1], _SUFFIX.get(name[-1], 8)
        return name, (known[-1] if known else 8) or 1

    # ---- groups --------------------------------------------------------------------------------------------------

    def _mov(self, i: Instruction, size: int) -> Effect | None:
        if len(i.operands) != 2 or any(o.startswith("%xmm") for o in i.operands):
            return self._unknown(i)
        read, write = self.reader(i, i.operands[0], size), self.writer(i, i.operands[1], size)
        if i.operands[0] == "%rsp" and i.operands[1] != "%rbp":
            return escaping(read, write)
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
                if with_sign:
                    v = number(signed(v[1], from_size * 8)) if v is not None and v[0] == "" else None
                write(s, v)

            n = REGISTERS.get(i.operands[1][1:], (0, 0))[0]

            def write_word(s: State, v: Value) -> None:
                s.registers[n] = v if with_sign and to_size == 8 else None

            return run

        return make

    def _lea(self, i: Instruction, size: int) -> Effect | None:
        where, write = self.address(i, i.operands[0]), self.writer(i, i.operands[1], size)
        if where is None:
            return self._unknown(i)
        return escaping(where, write) if i.operands[1] != "%rsp" else lambda s: write(s, where(s))

    def _push(self, i: Instruction, size: int) -> Effect | None:
        read = self.reader(i, i.operands[0], 8)

        def run(s: State) -> None:
            value = read(s)
            s.registers[RSP] = plus(s.registers[RSP], number(-8))
            s.store(s.registers[RSP], 8, value)

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
            return lambda s: compare(s, name, of(s), by(s), bits)
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
            result = binary(name, a, b, bits)
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
        """Makes unknown what the instruction could change: its last operand and the flags, or every register if that is
        uncertain."""
        target = i.operands[-1] if i.operands else ""
        if target.startswith(("%xmm", "%ymm")):
            return forget_flags if "comis" in i.mnemonic or i.mnemonic.startswith(("ptest", "vptest")) else None
        if target[1:] in REGISTERS and len(i.operands) >= 2 and not i.mnemonic.startswith(("xchg", "xadd", "cmpxchg")):
            n = REGISTERS[target[1:]][0]

            def forget(s: State) -> None:
                s.registers[n] = None
                s.flags = None

            return forget
        where = self.address(i, target)
        if where is not None and i.operands[0].startswith(("%xmm", "%ymm")):
            at, size = where, _VECTOR_STORES.get(i.mnemonic, 32)
            return lambda s: s.store(at(s), size, None)

        def all_of_it(s: State) -> None:
            stack = s.registers[RSP]
            s.registers, s.flags = [None] * 16, None
            s.registers[RSP] = stack
            s.memory = {}

        return all_of_it


def _repeated_store(d: Decoder, i: Instruction, size: int) -> Effect:
    def run(s: State) -> None:
        s.registers[1], s.registers[7] = ("", 0), None
        if "movs" in i.mnemonic:
            s.registers[6] = None
        s.forget()

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


def _unary(name: str) -> Callable[[Decoder, Instruction, int], Effect | None]:
    return lambda d, i, size: d._unary(name)(i, size)


_METHODS: dict[str, Callable[[Decoder, Instruction, int], Effect | None]] = {
    "mov": Decoder._mov,
    "movabs": Decoder._movabs,
    "lea": Decoder._lea,
    "push": Decoder._push,
    "pop": Decoder._pop,
    "leave": Decoder._leave,
    "mul": lambda d, i, size: d._wide(i, signed_operands=False, size=size),
    "div": lambda d, i, size: division,
    "idiv": lambda d, i, size: division,
    "rep stos": _repeated_store,
    "rep movs": _repeated_store,
    "rep movsq": _repeated_store,
    "rep movsl": _repeated_store,
    "rep movsb": _repeated_store,
    "cltq": _widened(0, 32),
    "cqto": _widened(2, 64),
    "cltd": _widened(2, 32),
    "xchg": lambda d, i, size: None if len(set(i.operands)) == 1 else d._unknown(i),
    **{name: _unary(name) for name in _UNARY},
    **{
        f"mov{sign}{a}{b}": _extension(_SUFFIX[a], _SUFFIX[b], sign == "s")
        for sign in "sz"
        for a, b in ("bw", "bl", "bq", "wl", "wq", "lq")
        if (sign, a) != ("z", "l")
    },
}
