/* SPDX-License-Identifier: Apache-2.0
 *
 * The switch of mutants in C: tree.py builds it as a library that every program and library with mutants loads. $FCSL_MUTANT is
 * the number of the mutant to execute. Numbers that execution reaches are noted in the file $FCSL_MUTANTS_REACHED, a byte each,
 * which all processes of a test share.
 */
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

/* As fcsl_mutants.py. */
enum { SIZE = 65536 };

static unsigned long active;
static volatile unsigned char *reached;

__attribute__((constructor)) static void fcsl_mutants_open(void)
{
    const char *number = getenv("FCSL_MUTANT");
    const char *path = getenv("FCSL_MUTANTS_REACHED");
    active = number != NULL ? strtoul(number, NULL, 10) : 0;
    const int file = path != NULL ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file < 0) {
        return;
    }
    void *memory = mmap(NULL, SIZE, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    reached = memory != MAP_FAILED ? memory : NULL;
    (void)close(file);
}

int fcsl_mutant(unsigned number);

int fcsl_mutant(unsigned number)
{
    if (reached != NULL && number < SIZE) {
        reached[number] = 1;
    }
    return number == active;
}
