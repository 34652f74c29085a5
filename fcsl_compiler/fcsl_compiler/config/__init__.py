# SPDX-License-Identifier: Apache-2.0
"""The machine JSON: every name resolved, the schedule ordered, what does not fit refused."""
