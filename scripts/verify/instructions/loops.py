# SPDX-License-Identifier: Apache-2.0
"""How often loops of fcsl_math turn whose ends its machine code does not tell: read from CORE-MATH's source (1.4.0).

By function: (a mnemonic that the loop has, "" for any; turns that it makes at most, the one that leaves it included).
table.py counts calls that take these loops far.
"""

#: A search among at most 62 arguments, halved at every turn.
_SEARCH = (("", 7),)
#: gcc's loop for a function that calls itself at its end: with the operands swapped, which happens once.
_SWAP = (("", 2),)

MOST_TURNS = {
    **{f"as_{name}_database": _SEARCH for name in ("asin", "cosh", "exp", "expm1", "sinh", "tanh")},
    **dict.fromkeys(("add_dint", "add_qint", "add_qint_22"), _SWAP),
    # The integer root of a sum of squares below 2^107, from one of binary64 that is less than 2 off: tm is twice as far off, and 1.
    "as_hypot_denorm": (("", 6),),
    # Three steps down (the first loop), and up again past a root that is less than 2 off.
    "as_hypot_hard": (("", 7),),
    # is_exact takes roots of x = m 2^e: e is even, and halved, each time (|e| <= 1074), or 0, and then m < 2^53 is a square each time.
    # exact_pow goes through the bits of an exponent of at most 34. is_exact multiplies as often as the odd factor of y says: it looks only at
    # y whose lowest 42 bits are 0, so that is below 2^11.
    "cr_pow": (("sqrtsd", 12), ("seto", 6), ("", 2047)),
    # Likewise |e| <= 149, and the lowest 16 bits of y are 0.
    "cr_powf": (("sqrtss", 9), ("", 255)),
    # Its callers pass polynomials of 13 and 18 coefficients.
    "polydd": (("", 17),),
}
