/*
 * Large arrays begin on a line of the cache, ask for large pages, and are kept for the next of their
 * size when they are given back.
 *
 * The linker sends every malloc and free of Talus' own objects here (-Wl,--wrap=malloc,--wrap=free),
 * and with them every allocate and deallocate of Fortran. As glibc returns large blocks they begin
 * 16 bytes behind a line, so that each record of 64 bytes lies across two; and it gives them back to
 * the system, which clears each page before it hands it out again: a second for a gigabyte.
 *
 * Memory in use does not grow by what is kept: a block that is not there is allocated after
 * as much of what is kept has been freed.
 *
 * Where there is no memory for a block of Talus the program ends here with one message and exit code 4:
 * no allocate has a stat, and the message of the runtime would leave with 1, an input fault.
 */
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { LINE = 64, LARGE = 4096, SEVERAL_LARGE_PAGES = 4 << 20, KEPT = 64, SPARE_PART = 8 };

void *__real_malloc(size_t size);
void *__wrap_malloc(size_t size);
void __real_free(void *block);
void __wrap_free(void *block);
void talus_keep_memory(void);
void talus_give_back(void);

static int keeping;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static void *kept[KEPT]; /* blocks, the oldest first */
static size_t room[KEPT];
static int count;

static void *take(int place)
{
    void *block = kept[place];

    count--;
    memmove(kept + place, kept + place + 1, (size_t)(count - place) * sizeof *kept);
    memmove(room + place, room + place + 1, (size_t)(count - place) * sizeof *room);
    return block;
}

/* The kept block that fits best; without one, others of that size in all go back. */
static void *find(size_t size)
{
    void *block = NULL;
    size_t gone = 0;
    int best = -1;

    pthread_mutex_lock(&lock);
    for (int k = 0; k < count; k++) {
        if (room[k] < size || room[k] - size > size / SPARE_PART) continue;
        if (best < 0 || room[k] < room[best]) best = k;
    }
    if (best >= 0) block = take(best);
    while (block == NULL && count > 0 && gone < size) {
        gone += room[0];
        __real_free(take(0));
    }
    pthread_mutex_unlock(&lock);
    return block;
}

/* Memory of this process in MiB, 0 if the system does not tell. */
static long in_use(void)
{
    char text[128] = "";
    char *rest;
    const int file = open("/proc/self/statm", O_RDONLY);

    if (file < 0) return 0;
    if (read(file, text, sizeof text - 1) < 0) text[0] = 0;
    (void)close(file);
    (void)strtol(text, &rest, 10);
    return strtol(rest, NULL, 10) * (sysconf(_SC_PAGESIZE) / 1024) / 1024;
}

/*
 * The end: one line in one write, so that those of ranks do not mix and a partner's report of the last
 * lines has it, and a new one, as progress may stand in the one before; without memory of its own.
 */
static void no_memory(size_t size)
{
    char text[512];
    const char *rank = getenv("OMPI_COMM_WORLD_RANK");
    const int length = snprintf(text, sizeof text,
        "\nerror %s: no memory for %.1f MiB more%s%s, %ld MiB are in use: take a"
        " smaller model, more ranks on more machines, or a machine with more memory; the last checkpoint"
        " is valid\n",
        "S018", (double)size / 1048576.0, rank ? " on rank " : "", rank ? rank : "", in_use());

    if (length > 0 && write(STDERR_FILENO, text, (size_t)length) < 0) _exit(4);
    _exit(4);
}

void *__wrap_malloc(size_t size)
{
    void *block = NULL;

    if (size < LARGE) {
        block = __real_malloc(size);
        if (block == NULL && size > 0) no_memory(size);
        return block;
    }
    if (size >= SEVERAL_LARGE_PAGES) {
        block = find(size);
        if (block != NULL) return block;
    }
    if (posix_memalign(&block, LINE, size) != 0) {
        talus_give_back();
        if (posix_memalign(&block, LINE, size) != 0) no_memory(size);
    }
    if (size >= SEVERAL_LARGE_PAGES) {
        const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
        const uintptr_t low = ((uintptr_t)block + page - 1) & ~(page - 1);
        const uintptr_t high = ((uintptr_t)block + size) & ~(page - 1);
        /* where it is refused, small pages do */
        (void)madvise((void *)low, high - low, MADV_HUGEPAGE);
    }
    return block;
}

void __wrap_free(void *block)
{
    size_t size = 0;

    if (keeping && block != NULL && (uintptr_t)block % LINE == 0) size = malloc_usable_size(block);
    if (size < SEVERAL_LARGE_PAGES) {
        __real_free(block);
        return;
    }
    pthread_mutex_lock(&lock);
    if (count == KEPT) __real_free(take(0));
    kept[count] = block;
    room[count] = size;
    count++;
    pthread_mutex_unlock(&lock);
}

/*
 * Keep large blocks from now on. Not for programs in which libraries, whose malloc is not ours, take
 * most of the memory.
 */
void talus_keep_memory(void)
{
#ifndef __SANITIZE_ADDRESS__
    keeping = 1;
#endif
}

/* Return all that is kept to the system. */
void talus_give_back(void)
{
    pthread_mutex_lock(&lock);
    while (count > 0) __real_free(take(count - 1));
    pthread_mutex_unlock(&lock);
}
