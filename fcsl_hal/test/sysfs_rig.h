/* SPDX-License-Identifier: Apache-2.0
 *
 * A tree of files that stands for sysfs, faults of its files, and a driver under test.
 */
#ifndef FCSL_SYSFS_RIG_H
#define FCSL_SYSFS_RIG_H

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <math.h>
#include <stdalign.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"
#include "drivers.h"
#include "fcsl_check.h"

enum { TREE_BYTES = 256, STATE_BYTES = 4096, WHY_BYTES = 256, SIGNALS_MAX = 16, NOBODY = 65534 };

/* ---- faults ------------------------------------------------------------------------------------------------------------- */

static int fault; /* the errno of every pread, or 0 */
static const char *refused; /* what no file takes: EINVAL, as of an attribute; or null */

/* They take the place of libc's in the driver, too: only sysfs itself gives such errors. */
ssize_t pread(int file, void *bytes, size_t size, off_t offset)
{
    if (fault != 0) {
        errno = fault;
        return -1;
    }
    return (ssize_t)syscall(SYS_pread64, file, bytes, size, offset);
}

ssize_t write(int file, const void *bytes, size_t size)
{
    if (refused != NULL && size == strlen(refused) && memcmp(bytes, refused, size) == 0) {
        errno = EINVAL;
        return -1;
    }
    return (ssize_t)syscall(SYS_write, file, bytes, size);
}

/* ---- tree --------------------------------------------------------------------------------------------------------------- */

static char tree[] = "/tmp/fcsl-sysfs-XXXXXX";

static inline void make_tree(void)
{
    CHECK(mkdtemp(tree) != NULL && chmod(tree, 0755) == 0); /* one that is not root looks into it, too */
    CHECK(setenv("FCSL_SYSFS", tree, 1) == 0);
}

static inline const char *in_tree(const char *path)
{
    static char full[2][TREE_BYTES]; /* for two paths in one expression */
    static int next;
    next = !next;
    CHECK(snprintf(full[next], TREE_BYTES, "%s/%s", tree, path) < TREE_BYTES);
    return full[next];
}

static inline void make_parents(const char *path)
{
    char full[TREE_BYTES];
    CHECK(snprintf(full, sizeof full, "%s", in_tree(path)) < TREE_BYTES);
    for (char *slash = strchr(full + strlen(tree) + 1, '/'); slash != NULL; slash = strchr(slash + 1, '/')) {
        *slash = '\0';
        CHECK(mkdir(full, 0755) == 0 || errno == EEXIST);
        *slash = '/';
    }
}

static inline void put_bytes(const char *path, const void *bytes, size_t size)
{
    make_parents(path);
    FILE *file = fopen(in_tree(path), "wb");
    CHECK(file != NULL && fwrite(bytes, 1, size, file) == size && fclose(file) == 0);
}

static inline void put(const char *path, const char *text)
{
    put_bytes(path, text, strlen(text));
}

/* Whether a file has this text. */
static inline int has(const char *path, const char *text)
{
    char bytes[TREE_BYTES] = "";
    FILE *file = fopen(in_tree(path), "rb");
    if (file == NULL) {
        return 0;
    }
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    CHECK(fclose(file) == 0);
    return size == strlen(text) && memcmp(bytes, text, size) == 0;
}

static int remove_one(const char *path, const struct stat *status, int flag, struct FTW *walk)
{
    (void)status;
    (void)flag;
    (void)walk;
    return remove(path);
}

static inline void remove_below(const char *path)
{
    CHECK(nftw(in_tree(path), remove_one, 16, FTW_DEPTH | FTW_PHYS) == 0);
}

static inline void remove_tree(void)
{
    CHECK(nftw(tree, remove_one, 16, FTW_DEPTH | FTW_PHYS) == 0);
}

static inline int count_files(void)
{
    int count = 0;
    DIR *folder = opendir("/proc/self/fd");
    CHECK(folder != NULL);
    while (readdir(folder) != NULL) {
        count++;
    }
    CHECK(closedir(folder) == 0);
    return count;
}

/* Files are read as one who is not root. 0, or -1: this is not possible here. */
static inline int drop_root(void)
{
    return geteuid() != 0 || seteuid(NOBODY) == 0 ? 0 : -1;
}

static inline void restore_root(void)
{
    CHECK(getuid() != 0 || seteuid(0) == 0);
}

/* ---- driver ------------------------------------------------------------------------------------------------------------- */

typedef struct {
    const fcsl_driver_t *driver;
    alignas(16) uint8_t self[STATE_BYTES];
    uint64_t sample_ns;
    char why[WHY_BYTES];
} rig_t;

/* Opens a device with the signals whose names are in `used`, divided by spaces; "gyro?" is optional. */
static inline fcsl_driver_status_t rig_open(rig_t *rig, const fcsl_driver_t *driver, const char *device,
                                            const char *used)
{
    uint8_t flags[SIGNALS_MAX] = {0};
    CHECK(driver->abi_version == FCSL_DRIVER_ABI_VERSION && driver->direction == FCSL_SENSOR);
    CHECK(driver->state_size <= STATE_BYTES && driver->state_align <= 16u && driver->signal_count <= SIGNALS_MAX);
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        const char *name = driver->signals[i].name;
        const char *found = strstr(used, name);
        const int optional = found != NULL && found[strlen(name)] == '?';
        flags[i] = optional ? FCSL_DRIVER_OPTIONAL : found != NULL ? FCSL_DRIVER_NEEDED : FCSL_DRIVER_UNUSED;
    }
    memset(rig, 0, sizeof *rig);
    rig->driver = driver;
    const fcsl_driver_status_t status = driver->open(rig->self, device, flags, rig->why, sizeof rig->why);
    CHECK(status != FCSL_DRIVER_NOTHING && (status == FCSL_DRIVER_OK) == (rig->why[0] == '\0'));
    return status;
}

static inline fcsl_driver_status_t rig_read(rig_t *rig)
{
    uint8_t before[STATE_BYTES];
    const uint64_t last_ns = rig->sample_ns;
    memcpy(before, rig->self, sizeof before);
    rig->why[0] = '\0';
    const fcsl_driver_status_t status = rig->driver->read(rig->self, &rig->sample_ns, rig->why, sizeof rig->why);
    CHECK(status == FCSL_DRIVER_OK || (rig->sample_ns == last_ns && memcmp(before, rig->self, sizeof before) == 0));
    CHECK((status == FCSL_DRIVER_OK || status == FCSL_DRIVER_NOTHING) == (rig->why[0] == '\0'));
    return status;
}

static inline void rig_close(rig_t *rig)
{
    rig->driver->close(rig->self);
}

/* Opens and fails with this status and a reason that has this text; leaves no file open. */
static inline int rig_open_fails(const fcsl_driver_t *driver, const char *device, const char *used,
                                 fcsl_driver_status_t status, const char *text)
{
    rig_t rig;
    const int files = count_files();
    const int fails = rig_open(&rig, driver, device, used) == status && strstr(rig.why, text) != NULL;
    if (!fails) {
        (void)fprintf(stderr, "%s: '%s'\n", device, rig.why);
    }
    return fails && count_files() == files;
}

/* Whether a probe gives this status and a reason with this text. */
static inline int probes(const fcsl_driver_t *driver, const char *device, fcsl_driver_status_t status, const char *text)
{
    char why[WHY_BYTES] = "";
    const int as_said = driver->probe(device, why, sizeof why) == status && strstr(why, text) != NULL;
    if (!as_said) {
        (void)fprintf(stderr, "%s: '%s'\n", device, why);
    }
    return as_said && (status == FCSL_DRIVER_OK) == (why[0] == '\0');
}

static inline double value_at(const rig_t *rig, const char *name, uint32_t index)
{
    double number = NAN;
    for (uint32_t i = 0; i < rig->driver->signal_count; i++) {
        const fcsl_driver_signal_t *signal = &rig->driver->signals[i];
        if (strcmp(signal->name, name) == 0) {
            CHECK(signal->type == FCSL_F64 && index < signal->count);
            memcpy(&number, rig->self + signal->offset + index * sizeof number, sizeof number);
            return number;
        }
    }
    CHECK(!"the driver has this signal");
    return number;
}

static inline int is_near(double value, double expected)
{
    return fabs(value - expected) <= 1e-12 * fabs(expected);
}

/* A program without standard input gets its number for a file of the driver, which is closed all the same. */
static inline void check_without_standard_input(const fcsl_driver_t *driver, const char *device, const char *used)
{
    rig_t rig;
    const int kept = dup(STDIN_FILENO);
    (void)close(STDIN_FILENO);
    CHECK(rig_open(&rig, driver, device, used) == FCSL_DRIVER_OK && fcntl(STDIN_FILENO, F_GETFD) != -1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    rig_close(&rig);
    CHECK(fcntl(STDIN_FILENO, F_GETFD) == -1);
    CHECK(kept < 0 || (dup2(kept, STDIN_FILENO) == STDIN_FILENO && close(kept) == 0));
}

#endif /* FCSL_SYSFS_RIG_H */
