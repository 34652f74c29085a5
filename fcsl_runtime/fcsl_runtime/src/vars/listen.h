/* SPDX-License-Identifier: Apache-2.0
 *
 * Where the variable server listens, and the token that a TCP client must send.
 */
#ifndef FCSL_VARS_LISTEN_H
#define FCSL_VARS_LISTEN_H

#include <sys/types.h>

#include "fcsl/fcsl_vars.h"

enum { ADDRESS_BYTES = 128, SECRET_BYTES = 129 };

typedef struct {
    int fd;                      /* -1: does not listen */
    int tcp;
    dev_t device; /* of the socket that a Unix server made: nothing else is removed */
    ino_t inode;
    char address[ADDRESS_BYTES]; /* as given, with the port that was taken */
    char secret[SECRET_BYTES];   /* "" for a Unix socket */
} listener_t;

/* 0, or -1 with `error`. */
int fcsl_listener_open(listener_t *listener, const fcsl_vars_options_t *options, fcsl_error_t *error);
/* Closes; removes a Unix socket. */
void fcsl_listener_close(listener_t *listener);

#endif /* FCSL_VARS_LISTEN_H */
