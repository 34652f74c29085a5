# SPDX-License-Identifier: Apache-2.0
"""The diagnostic codes: title, reason for the rule, a wrong example and its correction."""
