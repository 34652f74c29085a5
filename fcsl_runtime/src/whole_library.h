/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_WHOLE_LIBRARY_H
#define FCSL_WHOLE_LIBRARY_H

/* Why dlopen must not be given the file at `path`, or null: it is no regular file (a FIFO would be waited for, without an end),
 * or it is an ELF file that ends before what is loaded of it does (whoever touched what is missing would get a SIGBUS). A file
 * that cannot be read, or is no ELF file, is left to dlopen, which says so. */
const char *fcsl_library_flaw(const char *path);

#endif /* FCSL_WHOLE_LIBRARY_H */
