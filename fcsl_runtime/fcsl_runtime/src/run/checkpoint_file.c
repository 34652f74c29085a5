/* SPDX-License-Identifier: Apache-2.0
 *
 * Checkpoints as files.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "checkpoint.h"
#include "base/replace_file.h"
#include "run_internal.h"

int fcsl_run_save_file(const fcsl_run_t *run, const char *path, fcsl_error_t *error)
{
    uint8_t *bytes = malloc(fcsl_run_checkpoint_capacity(run));
    if (bytes == NULL) {
        return fcsl_fail(error, "out of memory for a checkpoint");
    }
    const int status = fcsl_replace_file(path, bytes, fcsl_run_checkpoint(run, bytes), error);
    free(bytes);
    return status;
}

/* Reads up to `capacity` bytes; returns how many there were, or -1. */
static ssize_t read_all(int fd, uint8_t *bytes, size_t capacity)
{
    size_t size = 0;
    while (size < capacity) {
        const ssize_t got = read(fd, bytes + size, capacity - size);
        if (got < 0 && errno != EINTR) {
            return -1;
        }
        if (got == 0) {
            break;
        }
        size += got > 0 ? (size_t)got : 0u;
    }
    return (ssize_t)size;
}

/* Only a regular file: a FIFO could keep its reader for ever. */
static int open_file(const char *path, int links, fcsl_error_t *error)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC | (links ? 0 : O_NOFOLLOW));
    struct stat status;
    if (fd < 0) {
        return fcsl_fail(error, "cannot read '%.200s': %s", path, strerror(errno));
    }
    if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
        (void)close(fd);
        return fcsl_fail(error, "cannot read '%.200s': not a regular file", path);
    }
    return fd;
}

ssize_t fcsl_checkpoint_read(const char *path, int links, uint8_t *bytes, size_t capacity, fcsl_error_t *error)
{
    const int fd = open_file(path, links, error);
    if (fd < 0) {
        return -1;
    }
    const ssize_t size = read_all(fd, bytes, capacity);
    const int reason = errno;
    (void)close(fd);
    return size >= 0 ? size : fcsl_fail(error, "cannot read '%.200s': %s", path, strerror(reason));
}

int fcsl_run_restore_file(fcsl_run_t *run, const char *path, int ignore_source_hash, fcsl_error_t *error)
{
    const size_t capacity = fcsl_run_checkpoint_capacity(run) + FCSL_OTHER_MEMORY_BYTES +
                            1u; /* one more than right, so that longer ones show */
    uint8_t *bytes = malloc(capacity);
    if (bytes == NULL) {
        return fcsl_fail(error, "out of memory for a checkpoint");
    }
    fcsl_error_t why = {{0}};
    const ssize_t size = fcsl_checkpoint_read(path, 1, bytes, capacity, error);
    int status = size < 0 ? -1 : fcsl_run_restore_checkpoint(run, bytes, (size_t)size, ignore_source_hash, &why);
    if (size >= 0 && status != 0) {
        status = fcsl_fail(error, "%.120s: %.380s", path, why.text);
    }
    free(bytes);
    return status;
}
