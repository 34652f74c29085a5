/* SPDX-License-Identifier: Apache-2.0
 *
 * Coverage on its way out of a machine: the words of a coverage build become memory that it shares with a file. So the
 * counts of every process come together in one place, and those of one that is killed are there, too.
 */
#define _GNU_SOURCE
#include "cover.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_codec.h"
#include "fcsl/fcsl_cover.h"

enum { PATH_BYTES = 4096, SYMBOL_BYTES = 512, HEAD_WORDS = 4, MODE = 0644 };
#define MAP_MAX   ((uint64_t)1 << 26)
#define WORDS_MAX ((uint64_t)1 << 22)

static pthread_mutex_t attaching = PTHREAD_MUTEX_INITIALIZER;

typedef struct {
    char path[PATH_BYTES];
    size_t map_room; /* bytes of the map, padded */
    size_t size;     /* bytes of the whole file */
} plan_t;

static int make_plan(const fcsl_cover_t *cover, const char *folder, const char *name, plan_t *plan, fcsl_error_t *error)
{
    if (cover->version != FCSL_COVER_VERSION || cover->map_bytes > MAP_MAX || cover->word_count > WORDS_MAX) {
        return fcsl_fail(error, "machine '%s' was built for coverage by another version of fcslc; build it again",
                         name);
    }
    const int length = snprintf(plan->path, sizeof plan->path, "%s/%s-%s.cover", folder, name, cover->id);
    if (length < 0 || length >= (int)sizeof plan->path) {
        return fcsl_fail(error, "the path of the coverage of machine '%s' is too long", name);
    }
    plan->map_room = (size_t)(cover->map_bytes + 7u) / 8u * 8u;
    plan->size = HEAD_WORDS * sizeof(uint64_t) + plan->map_room + 2u * (size_t)cover->word_count * sizeof(uint64_t);
    return 0;
}

static int cannot(const plan_t *plan, const char *why, fcsl_error_t *error)
{
    return fcsl_fail(error, "coverage cannot be kept in %s: %s", plan->path, why);
}

/* Makes the file as long as it must be; one that holds something else is refused. Its room is reserved, of an older one too, which
 * may have holes: a write through the map to a full disk would be SIGBUS. */
static int prepare(int file, const plan_t *plan, fcsl_error_t *error)
{
    struct stat state;
    if (fstat(file, &state) != 0) {
        return cannot(plan, strerror(errno), error);
    }
    if (!S_ISREG(state.st_mode)) {
        return cannot(plan, "it is not a regular file", error);
    }
    if (state.st_size != 0 && (uint64_t)state.st_size != plan->size) {
        return cannot(plan, "it is damaged, remove it", error);
    }
    const int status = posix_fallocate(file, 0, (off_t)plan->size);
    return status == 0 ? 0 : cannot(plan, strerror(status), error);
}

/* Writes what stands before the words, its first word last, or compares it. */
static int fill_head(uint64_t *memory, const fcsl_cover_t *cover, const plan_t *plan, fcsl_error_t *error)
{
    const uint64_t checksum = fcsl_crc32(0, cover->map, (size_t)cover->map_bytes);
    if (memory[0] == 0u) {
        memory[1] = cover->map_bytes;
        memory[2] = cover->word_count;
        memory[3] = checksum;
        memcpy(memory + HEAD_WORDS, cover->map, (size_t)cover->map_bytes);
        memory[0] = FCSL_COVER_MAGIC;
    }
    const int same = memory[0] == FCSL_COVER_MAGIC && memory[1] == cover->map_bytes && memory[2] == cover->word_count &&
                     memory[3] == checksum && memcmp(memory + HEAD_WORDS, cover->map, (size_t)cover->map_bytes) == 0;
    return same ? 0 : cannot(plan, "it is damaged, remove it", error);
}

/* The words in the file, with their checks behind them, shared by every process that counts into it; null with `error`. */
static uint64_t *map_words(int file, const fcsl_cover_t *cover, const plan_t *plan, fcsl_error_t *error)
{
    if (flock(file, LOCK_EX) != 0) {
        (void)cannot(plan, strerror(errno), error);
        return NULL;
    }
    if (prepare(file, plan, error) != 0) {
        return NULL;
    }
    uint64_t *const memory = mmap(NULL, plan->size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (memory == MAP_FAILED) {
        (void)cannot(plan, strerror(errno), error);
        return NULL;
    }
    if (fill_head(memory, cover, plan, error) != 0) {
        (void)munmap(memory, plan->size);
        return NULL;
    }
    return memory + HEAD_WORDS + plan->map_room / sizeof *memory;
}

/* Once a library: from then on it counts into the file, for as long as the process lives. */
static int attach(fcsl_cover_t *cover, const char *folder, const char *name, fcsl_error_t *error)
{
    plan_t plan;
    if (make_plan(cover, folder, name, &plan, error) != 0) {
        return -1;
    }
    const int file = open(plan.path, O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, MODE);
    if (file < 0) {
        return cannot(&plan, strerror(errno), error);
    }
    uint64_t *const words = map_words(file, cover, &plan, error);
    (void)flock(file, LOCK_UN); /* which closing does not do: the mapping holds the file */
    (void)close(file);
    if (words == NULL) {
        return -1;
    }
    __atomic_store_n(&cover->words, words, __ATOMIC_RELEASE);
    cover->attached = 1u;
    return 0;
}

int fcsl_cover_attach(void *library, const char *path, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    if (machine->name == NULL) {
        return 0; /* what is wrong with a descriptor is said elsewhere */
    }
    char symbol[SYMBOL_BYTES];
    const int length = snprintf(symbol, sizeof symbol, "%s%s", FCSL_COVER_SYMBOL, machine->name);
    fcsl_cover_t *const cover = length > 0 && length < (int)sizeof symbol ? dlsym(library, symbol) : NULL;
    if (cover == NULL) {
        return 0;
    }
    const char *const folder = getenv(FCSL_COVER_DIR);
    if (folder == NULL || folder[0] == '\0') {
        return fcsl_fail(
            error, "'%s' is built for coverage and not to be flown: run it by `fcsl cover`, or build it again", path);
    }
    (void)pthread_mutex_lock(&attaching);
    const int status = cover->attached != 0u ? 0 : attach(cover, folder, machine->name, error);
    (void)pthread_mutex_unlock(&attaching);
    return status;
}
