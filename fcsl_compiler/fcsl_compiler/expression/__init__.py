# SPDX-License-Identifier: Apache-2.0
"""Expressions over fields, as users write them in tests, studies, simulations and to a server of variables."""
