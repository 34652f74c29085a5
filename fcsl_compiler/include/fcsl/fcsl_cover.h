/* SPDX-License-Identifier: Apache-2.0
 *
 * What a machine that is built for coverage (`fcslc cover`) exports besides its descriptor, as fcsl_cover_<machine>.
 *
 * The words say what has run: a statement's line, each outcome of a decision, each combination of its conditions. They
 * only ever gain bits, by atomic operations, so threads and processes may share them: a host may point `words` at shared
 * memory of the same size before the machine is initialised. Without a host they are counted into the library itself.
 *
 * A file of coverage is FCSL_COVER_MAGIC, the length of the map in bytes, the number of words (three little-endian
 * 64-bit numbers), the map, padded with zeros to a multiple of 8 bytes, and the words.
 */
#ifndef FCSL_COVER_H
#define FCSL_COVER_H

#include <stdint.h>

#define FCSL_COVER_MAGIC   UINT64_C(0x31564f434c534346) /* "FCSLCOV1" */
#define FCSL_COVER_VERSION 1u
#define FCSL_COVER_SYMBOL  "fcsl_cover_" /* and the machine's name */
/* Environment: the folder that hosts keep their files in, one for each build of a machine. */
#define FCSL_COVER_DIR "FCSL_COVER_DIR"

typedef struct {
    uint32_t version;
    uint32_t attached; /* a host has put memory of its own behind `words`; the library stays loaded */
    const char *id;  /* of the map, as it enters the name of the file */
    const char *map; /* JSON: what each word stands for */
    uint64_t map_bytes;
    uint64_t word_count;
    uint64_t *words;
} fcsl_cover_t;

#endif /* FCSL_COVER_H */
