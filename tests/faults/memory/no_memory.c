/*
 * Memory that runs out on one rank, for tests: preloaded into Talus' programs. From the moment that
 * the file NO_MEMORY_FILE exists, what the program itself asks for is refused on the rank
 * NO_MEMORY_RANK ("alone": in a program without ranks). Libraries get what they ask for: how they
 * end is not ours.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static uintptr_t low, high; /* of the program in memory */
static const char *file;
static int victim;

void *__libc_malloc(size_t size);
void *__libc_memalign(size_t line, size_t size);

static int first_object(struct dl_phdr_info *info, size_t size, void *unused)
{
    (void)size;
    (void)unused;
    low = info->dlpi_addr;
    for (int k = 0; k < info->dlpi_phnum; k++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[k];
        if (part->p_type == PT_LOAD && low + part->p_vaddr + part->p_memsz > high)
            high = low + part->p_vaddr + part->p_memsz;
    }
    return 1; /* the first is the program */
}

__attribute__((constructor)) static void begin(void)
{
    const char *rank = getenv("OMPI_COMM_WORLD_RANK");
    const char *wanted = getenv("NO_MEMORY_RANK");

    file = getenv("NO_MEMORY_FILE");
    victim = file && wanted && strcmp(wanted, rank ? rank : "alone") == 0;
    dl_iterate_phdr(first_object, NULL);
}

static int refused(const void *caller)
{
    const uintptr_t from = (uintptr_t)caller;

    return victim && from >= low && from < high && access(file, F_OK) == 0;
}

void *malloc(size_t size)
{
    if (refused(__builtin_return_address(0))) {
        errno = ENOMEM;
        return NULL;
    }
    return __libc_malloc(size);
}

int posix_memalign(void **block, size_t line, size_t size)
{
    if (refused(__builtin_return_address(0)))
        return ENOMEM;
    *block = __libc_memalign(line, size);
    return *block ? 0 : ENOMEM;
}
