/* SPDX-License-Identifier: Apache-2.0 */
#include "chain_by_hand.h"

#include <stddef.h>

static void run(link_t *l)
{
    l->y = l->x + 1.0;
}

static void feed(link_t *l)
{
    l[1].x = l[0].y;
    run(&l[1]);
}

static void chain_3(link_t *l)
{
    run(&l[0]);
    feed(&l[0]);
    feed(&l[1]);
}

static void chain_17(link_t *l)
{
    run(&l[0]);
    feed(&l[0]);
    feed(&l[1]);
    feed(&l[2]);
    feed(&l[3]);
    feed(&l[4]);
    feed(&l[5]);
    feed(&l[6]);
    feed(&l[7]);
    feed(&l[8]);
    feed(&l[9]);
    feed(&l[10]);
    feed(&l[11]);
    feed(&l[12]);
    feed(&l[13]);
    feed(&l[14]);
    feed(&l[15]);
}

/* Nobody writes a hundred calls. */
static void chain_of(link_t *l, int links)
{
    run(&l[0]);
    for (int i = 0; i + 1 < links; ++i) {
        feed(&l[i]);
    }
}

static void chain_100(link_t *l)
{
    chain_of(l, 100);
}

static void chain_1000(link_t *l)
{
    chain_of(l, 1000);
}

chain_t chain_by_hand(int links)
{
    switch (links) {
    case 3:
        return chain_3;
    case 17:
        return chain_17;
    case 100:
        return chain_100;
    case 1000:
        return chain_1000;
    default:
        return NULL;
    }
}
