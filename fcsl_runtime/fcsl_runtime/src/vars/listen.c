/* SPDX-License-Identifier: Apache-2.0
 *
 * The listening socket and the token file.
 */
#define _GNU_SOURCE
#include "listen.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_address.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_socket.h"

enum { BACKLOG = 64, RANDOM_BYTES = 24, SECRET_MIN = 16, HOST_BYTES = 64 };

/* ---- the token ----------------------------------------------------------------------------------------------------- */

/* Reads what stands in the file, without blanks at its end; a token is 16 to 128 printable characters. */
static int read_secret(int fd, const char *path, char *secret, fcsl_error_t *error)
{
    struct stat status;
    if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode) || status.st_uid != geteuid() ||
        (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
        return fcsl_fail(error, "token file '%s' must be a file of yours that nobody else can read: chmod 600 it",
                         path);
    }
    const ssize_t got = read(fd, secret, SECRET_BYTES);
    size_t length = got > 0 ? (size_t)got : 0;
    while (length > 0 && (secret[length - 1] == '\n' || secret[length - 1] == '\r' || secret[length - 1] == ' ')) {
        length--;
    }
    int plain = length >= SECRET_MIN && length < SECRET_BYTES;
    for (size_t i = 0; plain && i < length; i++) {
        plain = secret[i] > ' ' && secret[i] < 127;
    }
    secret[plain ? length : 0] = '\0';
    return plain ? 0 : fcsl_fail(error, "token file '%s' must hold 16 to 128 printable characters", path);
}

/* The file gets its name when it is whole: one that was killed in between must not be in the way of the next. */
static int make_secret(const char *path, char *secret, fcsl_error_t *error)
{
    uint8_t bytes[RANDOM_BYTES];
    char part[PATH_MAX];
    const int named = snprintf(part, sizeof part, "%s.%ld", path, (long)getpid());
    if (named < 0 || (size_t)named >= sizeof part) {
        return fcsl_fail(error, "cannot make token file '%s': its path is too long", path);
    }
    (void)unlink(part); /* of a process of this number that was killed */
    const int fd = open(part, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (fd < 0) {
        return fcsl_fail(error, "cannot make token file '%s': %s", path, strerror(errno));
    }
    int made = getrandom(bytes, sizeof bytes, 0) == (ssize_t)sizeof bytes;
    for (size_t i = 0; i < sizeof bytes; i++) {
        (void)snprintf(secret + 2u * i, 3, "%02x", bytes[i]);
    }
    const size_t length = strlen(secret);
    made = made && write(fd, secret, length) == (ssize_t)length && write(fd, "\n", 1) == 1;
    made = close(fd) == 0 && made && link(part, path) == 0;
    const int reason = errno;
    (void)unlink(part);
    errno = reason;
    if (!made) {
        return fcsl_fail(error, "cannot write token file '%s': %s", path, strerror(errno));
    }
    return 0;
}

static int open_secret(const char *path, char *secret, fcsl_error_t *error)
{
    const int fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) {
        return errno == ENOENT ? make_secret(path, secret, error)
                               : fcsl_fail(error, "cannot read token file '%s': %s", path, strerror(errno));
    }
    const int status = read_secret(fd, path, secret, error);
    (void)close(fd);
    return status;
}

/* ---- TCP ----------------------------------------------------------------------------------------------------------- */

static void note_address(listener_t *listener)
{
    struct sockaddr_storage address = {0};
    socklen_t length = sizeof address;
    char host[HOST_BYTES] = "";
    char port[16] = "";
    if (getsockname(listener->fd, (struct sockaddr *)&address, &length) == 0) {
        (void)getnameinfo((struct sockaddr *)&address, length, host, sizeof host, port, sizeof port,
                          NI_NUMERICHOST | NI_NUMERICSERV);
    }
    const char *form = address.ss_family == AF_INET6 ? "tcp:[%s]:%s" : "tcp:%s:%s";
    (void)snprintf(listener->address, sizeof listener->address, form, host, port);
}

static int listen_tcp(listener_t *listener, const fcsl_vars_options_t *options, fcsl_error_t *error)
{
    struct sockaddr_storage address;
    socklen_t length = 0;
    const int on = 1;
    if (options->token == NULL) {
        return fcsl_fail(error, "a TCP server needs a file for its token: --token FILE");
    }
    if (fcsl_address_read(options->address + 4, &address, &length) != 0) {
        return fcsl_fail(error,
                         "cannot listen on '%.128s': write tcp:HOST:PORT with a numeric address or localhost, such as "
                         "tcp:127.0.0.1:7500",
                         options->address);
    }
    listener->fd = socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    /* So that a restart need not wait for connections of the last run to time out. */
    const int bound = listener->fd >= 0 && setsockopt(listener->fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
                      bind(listener->fd, (const struct sockaddr *)&address, length) == 0 &&
                      listen(listener->fd, BACKLOG) == 0;
    if (!bound) {
        return fcsl_fail(error, "cannot listen on %s: %s", options->address, strerror(errno));
    }
    listener->tcp = 1;
    note_address(listener);
    return open_secret(options->token, listener->secret, error);
}

int fcsl_listener_open(listener_t *listener, const fcsl_vars_options_t *options, fcsl_error_t *error)
{
    *listener = (listener_t){.fd = -1};
    if (strncmp(options->address, "tcp:", 4) == 0) {
        if (listen_tcp(listener, options, error) != 0) {
            fcsl_listener_close(listener);
            return -1;
        }
        return 0;
    }
    if (options->token != NULL) {
        return fcsl_fail(error, "a token is asked for over TCP only; a Unix socket is open to its owner alone");
    }
    listener->fd = fcsl_socket_listen(options->address, SOCK_STREAM, BACKLOG, error);
    if (listener->fd < 0) {
        return -1;
    }
    struct stat status;
    if (lstat(options->address, &status) == 0) {
        listener->device = status.st_dev;
        listener->inode = status.st_ino;
    }
    (void)snprintf(listener->address, sizeof listener->address, "%s", options->address);
    return fcntl(listener->fd, F_SETFL, O_NONBLOCK) == 0 ? 0 : fcsl_fail(error, "cannot set up the socket");
}

void fcsl_listener_close(listener_t *listener)
{
    if (listener->fd >= 0) {
        /* First the name: a server that starts now would take a socket that refuses for one that a dead process left, and we
         * would remove its own. */
        struct stat status;
        if (!listener->tcp && listener->address[0] != '\0' && lstat(listener->address, &status) == 0 &&
            status.st_dev == listener->device && status.st_ino == listener->inode) {
            (void)unlink(listener->address);
        }
        (void)close(listener->fd);
    }
    listener->fd = -1;
}
