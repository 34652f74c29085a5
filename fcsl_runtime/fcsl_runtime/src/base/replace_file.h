/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_REPLACE_FILE_H
#define FCSL_REPLACE_FILE_H

#include <stddef.h>

#include "fcsl/fcsl_run.h"

/* Makes `path` a file of these bytes, readable by all. Whatever happens meanwhile, a kill or a power cut too, `path` is either
 * what it was or the new file whole: the bytes go to `path`.tmp, reach the disk, and take the name then. A symbolic link is
 * replaced, not followed; where it leads to a device or a FIFO, or `path` is one, nothing is done: whoever has the right could
 * otherwise replace /dev/null. 0, or -1 with `error`. */
int fcsl_replace_file(const char *path, const void *bytes, size_t size, fcsl_error_t *error);
/* Whether that can be done now, so that a flight need not end before somebody hears that it cannot: 0, or -1 with `error`. */
int fcsl_replace_file_check(const char *path, fcsl_error_t *error);

#endif /* FCSL_REPLACE_FILE_H */
