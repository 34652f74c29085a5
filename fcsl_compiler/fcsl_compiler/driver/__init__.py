# SPDX-License-Identifier: Apache-2.0
"""From a machine JSON to a library: the passes, the C compiler, the cache."""
