/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <errno.h>, what generated code and CORE-MATH use (no errno is kept); see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_ERRNO_H
#define FCSL_BARE_METAL_ERRNO_H

#define EDOM   33
#define ERANGE 34

#endif
