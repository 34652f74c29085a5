/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_TELL_H
#define FC_TELL_H

/* Writes "fcsl-fc: ", the text and a newline on standard error, or leaves them out where that would wait: whoever holds the
 * other end of a pipe and does not read must not keep the program from ending. */
__attribute__((format(printf, 1, 2))) void tell(const char *format, ...);

#endif /* FC_TELL_H */
