# SPDX-License-Identifier: Apache-2.0
"""What the simulator raises besides fcsl_compiler's DiagnosticError (which points into a file)."""


class SimError(ValueError):
    """The simulator refused something; str() is the complete message."""
