/* SPDX-License-Identifier: Apache-2.0
 *
 * A chain of trivial blocks as an engineer would write it by hand in C: one call per block, each fed by the one before.
 */
#ifndef CHAIN_BY_HAND_H
#define CHAIN_BY_HAND_H

typedef struct {
    double x;
    double y;
} link_t;

/* One tick of a chain of that many links; null where nobody wrote one. */
typedef void (*chain_t)(link_t *links);
chain_t chain_by_hand(int links);

#endif /* CHAIN_BY_HAND_H */
