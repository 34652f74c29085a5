/* SPDX-License-Identifier: Apache-2.0
 *
 * Maps registers.
 */
#define _GNU_SOURCE
#include "register_window.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"

/* Beyond the end of a plain file, which /sys has for PCI, an access would be a signal. */
static int is_long_enough(int file, uint64_t bytes)
{
    struct stat status;
    return fstat(file, &status) == 0 && (!S_ISREG(status.st_mode) || (uint64_t)status.st_size >= bytes);
}

static int map(register_window_t *window, int file, fcsl_error_t *error)
{
    const board_registers_t *plan = window->plan;
    const uint64_t page = (uint64_t)sysconf(_SC_PAGESIZE);
    const uint64_t before = plan->offset % page;
    if (!is_long_enough(file, plan->offset + plan->bytes)) {
        return fcsl_fail(error, "registers of '%.300s': it is shorter than offset and bytes say", plan->file);
    }
    window->mapped_bytes = (size_t)(before + plan->bytes);
    void *mapped = mmap(NULL, window->mapped_bytes, plan->is_written ? PROT_READ | PROT_WRITE : PROT_READ, MAP_SHARED,
                        file, (off_t)(plan->offset - before));
    if (mapped == MAP_FAILED) {
        return fcsl_fail(error, "registers of '%.300s': %s", plan->file, strerror(errno));
    }
    window->mapped = mapped;
    window->words = (volatile uint32_t *)(void *)((uint8_t *)mapped + before);
    return 0;
}

int register_window_open(register_window_t *window, const board_registers_t *plan, fcsl_error_t *error)
{
    *window = (register_window_t){.plan = plan};
    /* O_SYNC: /dev/mem is not cached then. */
    const int file = open(plan->file, (plan->is_written ? O_RDWR : O_RDONLY) | O_SYNC | O_CLOEXEC);
    if (file < 0) {
        return fcsl_fail(error, "registers of '%.300s': %s", plan->file, strerror(errno));
    }
    const int status = map(window, file, error);
    (void)close(file);
    return status;
}

volatile uint32_t *register_window_at(const register_window_t *window, uint32_t address)
{
    const uint32_t at = address - window->plan->address; /* of a lower address: too much */
    return at < window->plan->bytes && at % sizeof(uint32_t) == 0u ? &window->words[at / sizeof(uint32_t)] : NULL;
}

void register_window_close(register_window_t *window)
{
    if (window->mapped != NULL) {
        (void)munmap(window->mapped, window->mapped_bytes);
        window->mapped = NULL;
    }
}
