/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_BUS_CONFIG_H
#define FCSL_BUS_CONFIG_H

#include <sys/socket.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bus.h"

enum { BUS_CONFIG_BYTES = 2048 };

/* Reads tcp:HOST:PORT; tcp/HOST:PORT, as Zenoh writes it, is the same. 0, or -1 when it is none. */
int fcsl_bus_endpoint_read(const char *endpoint, struct sockaddr_storage *address, socklen_t *length);

/* 0 when a session can have these options, or -1 with `error` filled. */
int bus_config_check(const fcsl_bus_options_t *options, fcsl_error_t *error);

/* Zenoh's configuration (JSON5) of a session with an endpoint. 0, or -1 with `error` filled. */
int bus_config_write(const fcsl_bus_options_t *options, char text[BUS_CONFIG_BYTES], fcsl_error_t *error);

#endif /* FCSL_BUS_CONFIG_H */
