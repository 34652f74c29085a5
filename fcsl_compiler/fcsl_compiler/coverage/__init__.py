# SPDX-License-Identifier: Apache-2.0
"""Coverage builds: probes, counts, MC/DC, the report."""
