# SPDX-License-Identifier: Apache-2.0
"""What other packages use of the compiler, by concept. They import nothing else of it. Each module imports what it offers, so
none of them costs more than what its concept needs.
"""
