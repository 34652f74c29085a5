# SPDX-License-Identifier: Apache-2.0
"""Names that a user chooses from. Command lines import this file and nothing that it stands for."""

#: Default target. Tests, twins and simulators use it.
DEFAULT_TARGET = "simulation"
#: Languages of generated source.
BACKENDS = ("c", "nim")
DEFAULT_BACKEND = "c"
#: Environment variable: machines that tests and simulations compile are built as by `fcsl build --times`.
TIMES = "FCSL_TIMES"
