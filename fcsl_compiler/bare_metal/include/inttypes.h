/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <inttypes.h>, what generated code and CORE-MATH use; see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_INTTYPES_H
#define FCSL_BARE_METAL_INTTYPES_H

#include <stdint.h>

#endif
