# SPDX-License-Identifier: Apache-2.0
"""Clients of the variable server (docs/reference/variables.md): VarClient, its subscriptions, and the command fcsl var."""
