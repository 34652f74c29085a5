/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <stdlib.h>, what generated code and CORE-MATH use (nothing); see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_STDLIB_H
#define FCSL_BARE_METAL_STDLIB_H

#include <stddef.h>

#endif
