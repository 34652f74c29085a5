/* SPDX-License-Identifier: Apache-2.0
 *
 * One defect each, which the sanitizers must report: argument "bounds", "overflow", "cast", "leak" or "race".
 * As a library, `control` does the same for a Python process.
 */
#include <limits.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static volatile int32_t number = INT32_MAX;
static volatile double large = 1e30;
static int shared;

static void *add(void *unused)
{
    for (int i = 0; i < 1000; i++) {
        shared++;
    }
    return unused;
}

static int race(void)
{
    pthread_t threads[2];
    for (int i = 0; i < 2; i++) {
        if (pthread_create(&threads[i], NULL, add, NULL) != 0) {
            return -1;
        }
    }
    for (int i = 0; i < 2; i++) {
        (void)pthread_join(threads[i], NULL);
    }
    return shared;
}

int control(const char *which)
{
    char *volatile bytes = malloc(8);
    if (bytes == NULL) {
        return -1;
    }
    memset(bytes, 0, 8);
    int result = 0;
    if (strcmp(which, "bounds") == 0) {
        result = bytes[8];
    } else if (strcmp(which, "overflow") == 0) {
        result = number + 1;
    } else if (strcmp(which, "cast") == 0) {
        result = (int32_t)large;
    } else if (strcmp(which, "race") == 0) {
        result = race();
    }
    if (strcmp(which, "leak") != 0) {
        free(bytes);
    }
    bytes = NULL;
    return result == 12345;
}

int main(int argc, char **argv)
{
    return argc == 2 ? control(argv[1]) : -1;
}
