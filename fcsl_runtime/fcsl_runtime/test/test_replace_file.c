/* SPDX-License-Identifier: Apache-2.0
 *
 * Files are replaced whole, or stay as they were; nothing is left beside them.
 */
#define _GNU_SOURCE
#include "base/replace_file.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl_check.h"

static char folder[] = "/tmp/test_replace_XXXXXX";
static char path[PATH_MAX];

static void check_content(const char *expected)
{
    char content[64] = "";
    FILE *file = fopen(path, "rb");
    CHECK(file != NULL);
    const size_t size = fread(content, 1, sizeof content, file);
    CHECK(fclose(file) == 0 && size == strlen(expected) && memcmp(content, expected, size) == 0);
}

static int count_files(void)
{
    int count = 0;
    DIR *entries = opendir(folder);
    CHECK(entries != NULL);
    while (readdir(entries) != NULL) {
        count++;
    }
    CHECK(closedir(entries) == 0);
    return count - 2; /* . and .. */
}

static void test_content(void)
{
    fcsl_error_t error;
    CHECK(fcsl_replace_file_check(path, &error) == 0 && count_files() == 0);
    CHECK(fcsl_replace_file(path, "a longer content", 16, &error) == 0);
    check_content("a longer content");
    CHECK(fcsl_replace_file_check(path, &error) == 0);
    check_content("a longer content");
    CHECK(fcsl_replace_file(path, "short", 5, &error) == 0);
    check_content("short");
    CHECK(fcsl_replace_file(path, "", 0, &error) == 0);
    check_content("");
    CHECK(count_files() == 1 && unlink(path) == 0);
}

/* The longest path has room for the ending of the temporary file. */
static void test_long_paths(void)
{
    fcsl_error_t error;
    char other[PATH_MAX + 8];
    for (size_t length = PATH_MAX - 8u; length < PATH_MAX + 4u; length++) {
        const int fits = length + strlen(".tmp") < PATH_MAX;
        const size_t first = strlen(folder);
        memcpy(other, folder, first);
        for (size_t at = first; at < length; at++) {
            other[at] = at == first || at + 1u == length || (at - first) % 2u == 0 ? '/' : '.';
        }
        other[length - 1u] = 'f'; /* "/tmp/test_replace_.../././f" */
        other[length - 2u] = '/';
        other[length] = '\0';
        const int status = fcsl_replace_file(other, "x", 1, &error);
        const int check = fcsl_replace_file_check(other, &error);
        CHECK((status == 0) == fits && (check == 0) == fits);
        CHECK(fits || strstr(error.text, "is too long") != NULL);
        CHECK(count_files() == fits && (!fits || unlink(other) == 0));
    }
}

static void check_refused(const char *what, const char *part)
{
    fcsl_error_t error;
    CHECK(fcsl_replace_file(what, "x", 1, &error) != 0 && strstr(error.text, part) != NULL);
    CHECK(fcsl_replace_file_check(what, &error) != 0 && strstr(error.text, part) != NULL);
    CHECK(strstr(error.text, what) != NULL);
}

static void test_what_cannot_be_written(void)
{
    CHECK(mkdir(path, 0700) == 0);
    check_refused(path, "not a regular file");
    CHECK(rmdir(path) == 0 && mkfifo(path, 0600) == 0);
    check_refused(path, "not a regular file");
    CHECK(count_files() == 1 && unlink(path) == 0);
    check_refused("/nonexistent/folder/file", "No such file or directory");
}

int main(void)
{
    CHECK(mkdtemp(folder) != NULL);
    CHECK(snprintf(path, sizeof path, "%s/file", folder) > 0);
    test_content();
    test_long_paths();
    test_what_cannot_be_written();
    CHECK(rmdir(folder) == 0);
    return 0;
}
