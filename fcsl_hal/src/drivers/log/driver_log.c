/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `log`: writes go into a file instead of a device, to try a plan of fcsl-guard and to test it. The file has LINES
 * lines of LINE_BYTES bytes; the newest write takes the place of the oldest. It is mapped, so a write is no system call, and
 * what was written is there whatever becomes of the process.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_driver.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

enum { LINES = 4096, LINE_BYTES = 256, FILE_BYTES = LINES * LINE_BYTES, SIGNALS = 4 };

typedef struct {
    double number;
    bool flag;
    double three[3];
    double four[4];
    uint8_t used[SIGNALS];
    char *lines;
    uint64_t written;
} log_t;

static const fcsl_driver_signal_t signals[SIGNALS] = {
    FCSL_DRIVER_SIGNAL(log_t, number, "", "a number"),
    FCSL_DRIVER_SIGNAL(log_t, flag, "", "a switch"),
    FCSL_DRIVER_SIGNAL(log_t, three, "", "three numbers"),
    FCSL_DRIVER_SIGNAL(log_t, four, "", "four numbers"),
};

static fcsl_driver_status_t probe_log(const char *device, char *why, size_t size)
{
    struct stat status;
    if (device[0] == '\0') {
        (void)snprintf(why, size, "name the file to write: log:FILE");
        return FCSL_DRIVER_ABSENT;
    }
    if (lstat(device, &status) == 0) {
        (void)snprintf(why, size, "'%s' exists and is left alone; name a new file", device);
        return FCSL_DRIVER_ABSENT;
    }
    return FCSL_DRIVER_OK;
}

static fcsl_driver_status_t open_log(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    log_t *log = self;
    const int file = open(device, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR);
    if (file < 0) {
        (void)snprintf(why, size, "cannot make '%s': %s", device, strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    /* The room is taken now: a disk that is full later would be a signal, not an error. */
    const int code = posix_fallocate(file, 0, FILE_BYTES);
    void *lines = MAP_FAILED;
    if (code == 0) {
        lines = mmap(NULL, FILE_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file, 0);
    }
    if (lines == MAP_FAILED) {
        (void)snprintf(why, size, "no room for '%s': %s", device, strerror(code != 0 ? code : errno));
        (void)close(file);
        return FCSL_DRIVER_FAILED;
    }
    (void)close(file);
    memcpy(log->used, used, sizeof log->used);
    log->lines = lines;
    return FCSL_DRIVER_OK;
}

/* Adds " name=value,…" (all signals and the time are 245 bytes at most) at `at` and returns the new end. */
static size_t put_signal(char *line, size_t at, const fcsl_driver_signal_t *signal, const log_t *log)
{
    const uint8_t *value = (const uint8_t *)log + signal->offset;
    for (uint32_t i = 0; i < signal->count && at < LINE_BYTES; i++) {
        const char *name = i == 0u ? signal->name : "";
        const char *before = i == 0u ? " " : ",";
        const char *behind = i == 0u ? "=" : "";
        double number = 0.0;
        if (signal->type == FCSL_F64) {
            memcpy(&number, value + (size_t)i * sizeof number, sizeof number);
        } else {
            number = value[i];
        }
        at += (size_t)snprintf(line + at, LINE_BYTES - at, "%s%s%s%.17g", before, name, behind, number);
    }
    return at;
}

static fcsl_driver_status_t write_log(void *self, char *why, size_t size)
{
    (void)why;
    (void)size;
    log_t *log = self;
    char line[LINE_BYTES];
    size_t at = (size_t)snprintf(line, sizeof line, "%20" PRIu64, fcsl_monotonic_ns());
    for (uint32_t i = 0; i < SIGNALS; i++) {
        at = log->used[i] != 0u ? put_signal(line, at, &signals[i], log) : at;
    }
    memset(line + at, ' ', sizeof line - at);
    /* A line that lacks its end is being written. */
    char *to = log->lines + (size_t)(log->written % LINES) * LINE_BYTES;
    to[LINE_BYTES - 1] = '\0';
    atomic_signal_fence(memory_order_seq_cst);
    memcpy(to, line, LINE_BYTES - 1);
    atomic_signal_fence(memory_order_seq_cst);
    to[LINE_BYTES - 1] = '\n';
    log->written++;
    return FCSL_DRIVER_OK;
}

static void close_log(void *self)
{
    log_t *log = self;
    (void)munmap(log->lines, FILE_BYTES);
}

const fcsl_driver_t fcsl_driver_log = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "log",
    .doc = "no device: a file, log:FILE, that holds the last 4096 writes and their times",
    .direction = FCSL_ACTUATOR,
    .signals = signals,
    .signal_count = SIGNALS,
    .state_size = sizeof(log_t),
    .state_align = _Alignof(log_t),
    .probe = probe_log,
    .open = open_log,
    .write = write_log,
    .close = close_log,
};
