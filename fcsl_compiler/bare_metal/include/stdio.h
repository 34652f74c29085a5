/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <stdio.h>, what generated code and CORE-MATH use (nothing: it prints nowhere); see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_STDIO_H
#define FCSL_BARE_METAL_STDIO_H

#include <stddef.h>

#endif
