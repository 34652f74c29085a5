/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <inttypes.h>, what generated code and CORE-MATH use; see ../runtime.c.
 */
#ifndef FCSL_PIL_INTTYPES_H
#define FCSL_PIL_INTTYPES_H

#include <stdint.h>

#endif
