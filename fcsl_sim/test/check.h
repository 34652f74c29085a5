/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_TEST_CHECK_H
#define FCSL_TEST_CHECK_H

#include <stdint.h>

#include "fcsl_check.h"

/* A small generator for test inputs, independent of the code under test. */
static inline uint64_t next_random(uint64_t *state)
{
    *state = *state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return *state >> 33;
}

#endif /* FCSL_TEST_CHECK_H */
