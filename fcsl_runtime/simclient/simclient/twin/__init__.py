# SPDX-License-Identifier: Apache-2.0
"""Machines that a test steps tick by tick: Twin and its kinds, what a test makes of them, and the plugin of pytest."""
