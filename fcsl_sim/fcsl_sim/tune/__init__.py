# SPDX-License-Identifier: Apache-2.0
"""Search for the parameters of controllers that a study's `tune` names."""
