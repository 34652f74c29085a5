/* SPDX-License-Identifier: Apache-2.0
 *
 * The stack of the calling thread.
 */
#ifndef FCSL_STACK_LEFT_H
#define FCSL_STACK_LEFT_H

#include <stddef.h>

/* Bytes between here and its end; SIZE_MAX if the system does not tell. */
size_t fcsl_stack_left(void);

#endif /* FCSL_STACK_LEFT_H */
