/* SPDX-License-Identifier: Apache-2.0
 *
 * Loaded into every process of the tests under ASan and UBSan, behind ASan's runtime.
 *
 * LeakSanitizer asks before it judges: programs that are not ours, Python above all, leave memory behind at their end, and
 * would be called faulty for it. UBSan beside ASan writes to standard error whatever its options say, where a test may
 * swallow it: it is told where reports go.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int __lsan_is_turned_off(void);

int __lsan_is_turned_off(void)
{
    char name[256];
    (void)snprintf(name, sizeof name, " %.200s ", program_invocation_short_name);
    return strstr(PROGRAMS, name) == NULL && strstr(name, " test_") == NULL;
}

__attribute__((constructor)) static void set_report_path(void)
{
    const char *path = getenv("FCSL_SANITIZER_REPORTS");
    void *library = dlopen("libubsan.so.1", RTLD_NOW | RTLD_NOLOAD);
    void *symbol = library != NULL ? dlsym(library, "__sanitizer_set_report_path") : NULL;
    void (*set)(const char *path) = NULL;
    memcpy(&set, &symbol, sizeof set);
    if (set != NULL && path != NULL) {
        set(path);
    }
}
