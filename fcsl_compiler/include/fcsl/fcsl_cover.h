/* SPDX-License-Identifier: Apache-2.0
 *
 * Additional export of a machine built for coverage (`fcsl cover`): fcsl_cover_<machine>.
 *
 * The words record what has run: lines of statements, outcomes of decisions, combinations of conditions. A word is 0 or has
 * its one value, by atomic operations, so threads and processes may share the words. A host may set `words` to shared memory
 * of the same size before it initialises the machine. By default the words are in the library itself.
 *
 * Behind the words each has a check (fcsl_cover_check_of), which is stored after it. One checksum of all words would be wrong
 * while another process counts, and of a process that was killed. A word without a check does not count: its process was
 * killed between the two, and the next one that gets there stores both.
 *
 * A coverage file contains FCSL_COVER_MAGIC, the length of the map in bytes, the number of words, the CRC-32 of the map (four
 * little-endian 64-bit numbers), the map, padded with zeros to a multiple of 8 bytes, the words and their checks.
 */
#ifndef FCSL_COVER_H
#define FCSL_COVER_H

#include <stdint.h>

#define FCSL_COVER_MAGIC   UINT64_C(0x32564f434c534346) /* "FCSLCOV2" */
#define FCSL_COVER_VERSION 2u
#define FCSL_COVER_SYMBOL  "fcsl_cover_" /* followed by the machine's name */
/* Environment variable: folder for the coverage files of hosts, one file for each build of a machine. */
#define FCSL_COVER_DIR "FCSL_COVER_DIR"

typedef struct {
    uint32_t version;
    uint32_t attached; /* a host has set `words` to its own memory; the library must stay loaded */
    const char *id;  /* identifies the map; part of the file name */
    const char *map; /* JSON: the meaning of each word */
    uint64_t map_bytes;
    uint64_t word_count;
    uint64_t *words; /* and their checks */
} fcsl_cover_t;

/* Another one for each value of each word. */
static inline uint64_t fcsl_cover_check_of(uint64_t word, uint64_t value)
{
    return ~value ^ (word + 1u) * UINT64_C(0x9e3779b97f4a7c15);
}

#endif /* FCSL_COVER_H */
