/* SPDX-License-Identifier: Apache-2.0
 *
 * Counts the instructions of a function call exactly: the processor traps after each of them (the trap flag of x86-64) from
 * the call's first instruction until it has returned. A repeated string instruction counts once for each repetition.
 */
#ifndef FCSL_VERIFY_STEPPED_H
#define FCSL_VERIFY_STEPPED_H

#include <stdint.h>

enum { STEPPED_MOST_BYTES = 1 << 20 };

typedef struct {
    uintptr_t own_begin; /* the code of which instructions are counted apart */
    uint32_t own_size;   /* bytes; 0: none is */
    uint64_t own;        /* instructions executed within it */
    uint64_t all;        /* and elsewhere, without what was called from places that are somebody else's */
    uint8_t apart[STEPPED_MOST_BYTES]; /* by offset in the code: 1 for such a place */
} stepped_t;

extern stepped_t stepped;

/* Once. Returns 0, or an errno. */
int stepped_begin(void);

/* The next call of `target` is counted; `stepped` has the counts after it. */
void stepped_arm(uintptr_t target);

#endif /* FCSL_VERIFY_STEPPED_H */
