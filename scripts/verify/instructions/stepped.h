/* SPDX-License-Identifier: Apache-2.0
 *
 * Counts the instructions of a function call exactly: the processor traps after each of them (the trap flag of x86-64) from
 * the call's first instruction until it has returned. A repeated string instruction counts once for each repetition.
 */
#ifndef FCSL_VERIFY_STEPPED_H
#define FCSL_VERIFY_STEPPED_H

#include <stdint.h>

enum { STEPPED_MOST_BYTES = 1 << 22 };

/* What a byte of the program's code is. */
enum {
    STEPPED_OTHER = 0, /* counts in all */
    STEPPED_OWN = 1,   /* counts in both */
    STEPPED_APART = 2  /* OWN, and a call out of it is somebody else's: what runs there counts nowhere */
};

typedef struct {
    uintptr_t begin; /* address that kinds[0] is of */
    uint64_t own;
    uint64_t all;
    uint8_t kinds[STEPPED_MOST_BYTES];
    uint8_t reached[STEPPED_MOST_BYTES]; /* 1: an OWN or APART instruction that was executed */
} stepped_t;

extern stepped_t stepped;

/* Once. Returns 0, or an errno. */
int stepped_begin(void);

/* The next call of `target` is counted; `stepped` has the counts after it. */
void stepped_arm(uintptr_t target);

#endif /* FCSL_VERIFY_STEPPED_H */
