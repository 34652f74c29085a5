# SPDX-License-Identifier: Apache-2.0
"""The exception of the simulator besides fcsl_compiler's DiagnosticError (which points into a file)."""


class SimError(ValueError):
    """An error of the simulator; str() is the complete message."""
