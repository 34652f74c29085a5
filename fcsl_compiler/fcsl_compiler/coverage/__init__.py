# SPDX-License-Identifier: Apache-2.0
"""Builds that count what ran: probes, counts, MC/DC, the report."""
