# SPDX-License-Identifier: Apache-2.0
"""The language as CPython runs it: the meaning that compiled code is compared with.

The user's own source runs under a small rewrite (rewrite.py): same file, same lines, so that a debugger stops in it and shows
numbers. Values carry their types while they run (values.py, arrays.py, structs.py); nothing here knows the checker or the
generated C. `ReferenceMachine` (machine.py) runs a whole machine on its flat memory.
"""
