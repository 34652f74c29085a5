/* SPDX-License-Identifier: Apache-2.0
 *
 * CHECK for test programs written in C; flight code does not use it.
 */
#ifndef FCSL_CHECK_H
#define FCSL_CHECK_H

#include <stdio.h>
#include <stdlib.h>

/* Ends the program with the place and the text of a condition that does not hold. */
#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);                       \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

#endif /* FCSL_CHECK_H */
