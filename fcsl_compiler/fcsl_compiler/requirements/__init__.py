# SPDX-License-Identifier: Apache-2.0
"""Requirements of a machine, and the monitor that is made of them: a machine of its own, in the language itself."""
