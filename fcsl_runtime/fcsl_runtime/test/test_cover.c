/* SPDX-License-Identifier: Apache-2.0
 *
 * The file that a machine built for coverage counts into: where it is, what it holds, which ones are refused. This program
 * itself is the library of such a machine, of which only the name is read.
 */
#include "run/cover.c"

#include <stdlib.h>

#include "fcsl_check.h"

enum { WORDS = 5, FILE_WORDS = 4 + 2 + 2 * WORDS, ROOM = FILE_WORDS + 8 };
#define MAP "{\"lines\":1}" /* 11 bytes: padded with zeros to 16 */
#define ID  "0123abcd"

static uint64_t own_words[2 * WORDS]; /* and their checks */
extern fcsl_cover_t fcsl_cover_probe;
__attribute__((visibility("default"))) fcsl_cover_t fcsl_cover_probe;

static const fcsl_machine_t probe = {.name = "probe"};
static char folder[] = "/tmp/test_cover_XXXXXX";
static char file_path[PATH_BYTES];
static void *library;

/* As the library is when it has just been loaded. */
static void reload(void)
{
    fcsl_cover_probe = (fcsl_cover_t){.version = FCSL_COVER_VERSION,
                                      .id = ID,
                                      .map = MAP,
                                      .map_bytes = sizeof MAP - 1u,
                                      .word_count = WORDS,
                                      .words = own_words};
}

static int attach_it(fcsl_error_t *error)
{
    error->text[0] = '\0';
    return fcsl_cover_attach(library, "libprobe.so", &probe, error);
}

/* The library stays as it was: it counts into its own words. */
static void check_refused(const char *part)
{
    fcsl_error_t error;
    CHECK(attach_it(&error) != 0 && strstr(error.text, part) != NULL);
    CHECK(fcsl_cover_probe.words == own_words && fcsl_cover_probe.attached == 0u);
}

static size_t read_file(uint64_t *content, size_t size)
{
    FILE *file = fopen(file_path, "rb");
    CHECK(file != NULL);
    const size_t got = fread(content, 1, size, file);
    CHECK(fclose(file) == 0);
    return got;
}

static void write_file(const void *content, size_t size)
{
    FILE *file = fopen(file_path, "wb");
    CHECK(file != NULL && fwrite(content, 1, size, file) == size && fclose(file) == 0);
}

static void test_who_is_not_counted(void)
{
    const fcsl_machine_t plain = {.name = "plain"};
    const fcsl_machine_t nameless = {.name = NULL};
    char endless[2 * SYMBOL_BYTES] = "";
    const fcsl_machine_t long_named = {.name = endless};
    fcsl_error_t error;
    memset(endless, 'a', sizeof endless - 1u);
    CHECK(fcsl_cover_attach(library, "x.so", &plain, &error) == 0);
    CHECK(fcsl_cover_attach(library, "x.so", &nameless, &error) == 0);
    CHECK(fcsl_cover_attach(library, "x.so", &long_named, &error) == 0);
}

/* Without `fcsl cover` such a machine does not run. */
static void test_no_folder(void)
{
    reload();
    CHECK(unsetenv(FCSL_COVER_DIR) == 0);
    check_refused("'libprobe.so' is built for coverage");
    CHECK(setenv(FCSL_COVER_DIR, "", 1) == 0);
    check_refused("'libprobe.so' is built for coverage");
}

/* What is counted is in the file, behind the map, with its checks; who comes later goes on with it. */
static void test_counts_are_in_the_file(void)
{
    fcsl_error_t error;
    uint64_t content[ROOM];
    const uint64_t expected[] = {FCSL_COVER_MAGIC, sizeof MAP - 1u, WORDS, fcsl_crc32(0, MAP, sizeof MAP - 1u)};
    reload();
    CHECK(attach_it(&error) == 0 && fcsl_cover_probe.attached == 1u && fcsl_cover_probe.words != own_words);
    uint64_t *const first = fcsl_cover_probe.words;
    for (uint64_t i = 0; i < 2u * WORDS; i++) {
        CHECK(first[i] == 0u);
        first[i] = i + 7u;
    }
    CHECK(read_file(content, sizeof content) == FILE_WORDS * 8u);
    CHECK(memcmp(content, expected, sizeof expected) == 0 && memcmp(content + 4, MAP "\0\0\0\0", 16) == 0);
    CHECK(memcmp(content + 6, first, 2 * WORDS * sizeof *first) == 0);
    CHECK(attach_it(&error) == 0 && fcsl_cover_probe.words == first); /* once a library */
    reload();
    CHECK(attach_it(&error) == 0 && fcsl_cover_probe.words != first);
    CHECK(memcmp(fcsl_cover_probe.words, first, 2 * WORDS * sizeof *first) == 0);
    fcsl_cover_probe.words[2] = 99u;
    CHECK(first[2] == 99u); /* one memory */
}

/* A file of another build of this name, or of another program, is left as it is. */
static void test_damaged_files(void)
{
    uint64_t good[ROOM];
    uint64_t bad[ROOM];
    uint64_t after[ROOM];
    const size_t size = read_file(good, sizeof good);
    for (size_t byte = 0; byte < 4u * 8u + sizeof MAP - 1u; byte++) {
        memcpy(bad, good, size);
        ((uint8_t *)bad)[byte] ^= 0x10u;
        write_file(bad, size);
        reload();
        check_refused("it is damaged, remove it");
        CHECK(read_file(after, sizeof after) == size && memcmp(after, bad, size) == 0);
    }
    for (size_t wrong = 1; wrong <= sizeof good; wrong += 3u) {
        if (wrong != size) {
            write_file(good, wrong);
            check_refused("it is damaged, remove it");
            CHECK(read_file(after, sizeof after) == wrong);
        }
    }
    write_file(good, size);
    fcsl_error_t error;
    CHECK(attach_it(&error) == 0);
}

static void test_what_cannot_be_a_file(void)
{
    CHECK(unlink(file_path) == 0 && mkfifo(file_path, 0600) == 0);
    reload();
    check_refused("it is not a regular file");
    CHECK(unlink(file_path) == 0 && mkdir(file_path, 0700) == 0);
    check_refused("coverage cannot be kept in");
    CHECK(rmdir(file_path) == 0);
    char endless[PATH_BYTES] = "";
    memset(endless, 'a', sizeof endless - 1u);
    CHECK(setenv(FCSL_COVER_DIR, endless, 1) == 0);
    check_refused("the path of the coverage of machine 'probe' is too long");
    CHECK(setenv(FCSL_COVER_DIR, folder, 1) == 0);
}

static void test_other_versions(void)
{
    reload();
    fcsl_cover_probe.version++;
    check_refused("built for coverage by another version of fcslc");
    reload();
    fcsl_cover_probe.map_bytes = MAP_MAX + 1u;
    check_refused("built for coverage by another version of fcslc");
    reload();
    fcsl_cover_probe.word_count = WORDS_MAX + 1u;
    check_refused("built for coverage by another version of fcslc");
}

int main(void)
{
    library = dlopen(NULL, RTLD_NOW);
    CHECK(library != NULL && mkdtemp(folder) != NULL);
    CHECK(snprintf(file_path, sizeof file_path, "%s/probe-" ID ".cover", folder) > 0);
    test_who_is_not_counted();
    test_no_folder();
    CHECK(setenv(FCSL_COVER_DIR, folder, 1) == 0);
    test_counts_are_in_the_file();
    test_damaged_files();
    test_what_cannot_be_a_file();
    test_other_versions();
    CHECK(rmdir(folder) == 0); /* nothing was left */
    return 0;
}
