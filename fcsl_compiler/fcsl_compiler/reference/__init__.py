# SPDX-License-Identifier: Apache-2.0
"""The reference: the language executed by CPython. Compiled code is compared with it.

The user's own source runs after a small rewrite (rewrite.py). File and lines stay the same, so that a debugger can stop
in it and show numbers. Values carry their types at run time (values.py, arrays.py, structs.py). The reference is
independent of the checker and the generated C. `ReferenceMachine` (machine.py) runs a whole machine on its flat memory.
"""
