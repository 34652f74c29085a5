/* SPDX-License-Identifier: Apache-2.0
 *
 * Additional export of a machine built for coverage (`fcslc cover`): fcsl_cover_<machine>.
 *
 * The words record what has run: lines of statements, outcomes of decisions, combinations of conditions. Bits are only set,
 * never cleared, by atomic operations, so threads and processes may share the words. A host may set `words` to shared memory
 * of the same size before it initialises the machine. By default the words are in the library itself.
 *
 * A coverage file contains FCSL_COVER_MAGIC, the length of the map in bytes, the number of words (three little-endian
 * 64-bit numbers), the map, padded with zeros to a multiple of 8 bytes, and the words.
 */
#ifndef FCSL_COVER_H
#define FCSL_COVER_H

#include <stdint.h>

#define FCSL_COVER_MAGIC   UINT64_C(0x31564f434c534346) /* "FCSLCOV1" */
#define FCSL_COVER_VERSION 1u
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
    uint64_t *words;
} fcsl_cover_t;

#endif /* FCSL_COVER_H */
