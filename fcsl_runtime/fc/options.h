/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_OPTIONS_H
#define FC_OPTIONS_H

#include <stdint.h>

typedef struct {
    const char *library;
    const char *machine;    /* null: the only one */
    const char *wire;       /* null: the stub HAL */
    const char *board;      /* null: simulated hardware */
    const char *socket;     /* null: no variable server */
    const char *token;      /* file with its token, for TCP */
    const char *record;     /* null: no recording */
    const char *name_space;
    uint64_t ticks;         /* 0: no limit */
    uint32_t timeout_ms;
    int realtime;
    int paused;
} options_t;

/* Reads the command line. Returns 0; 1 when help was printed; -1 after a message. */
int options_read(int argc, char **argv, options_t *options);

#endif /* FC_OPTIONS_H */
