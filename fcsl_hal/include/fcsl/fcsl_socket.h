/* SPDX-License-Identifier: Apache-2.0
 *
 * Unix-domain sockets as every part of FCSL opens them: readable by their owner only, never taken away from a live
 * listener, and cleaned up when the last one died without unlinking.
 */
#ifndef FCSL_SOCKET_H
#define FCSL_SOCKET_H

#include <stddef.h>

#include "fcsl/fcsl_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Binds and listens; `type` is SOCK_STREAM or SOCK_SEQPACKET. A path in use by a live listener, or by something that is
 * not a socket, is refused; a stale socket file is replaced. The caller unlinks `path` before closing.
 * Returns a descriptor (close-on-exec), or -1 with `error` filled. */
int fcsl_socket_listen(const char *path, int type, int backlog, fcsl_error_t *error);

/* Connects, without waiting for a listener that takes nobody; returns a descriptor (close-on-exec), or -1 with `error` filled. */
int fcsl_socket_connect(const char *path, int type, fcsl_error_t *error);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_SOCKET_H */
