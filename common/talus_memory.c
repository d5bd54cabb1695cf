/*
 * Large arrays begin on a line of the cache and ask for large pages.
 *
 * The linker sends every malloc of Talus' own objects here (-Wl,--wrap=malloc), and with it every
 * allocate of Fortran. As glibc hands out large blocks they begin 16 bytes behind a line, so that
 * each record of 64 bytes lies across two.
 */
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

enum { LINE = 64, LARGE = 16384, SEVERAL_LARGE_PAGES = 4 << 20 };

void *__real_malloc(size_t size);
void *__wrap_malloc(size_t size);

void *__wrap_malloc(size_t size)
{
    void *block = NULL;

    if (size < LARGE) return __real_malloc(size);
    if (posix_memalign(&block, LINE, size) != 0) return NULL;
    if (size >= SEVERAL_LARGE_PAGES) {
        const uintptr_t page = (uintptr_t)sysconf(_SC_PAGESIZE);
        const uintptr_t low = ((uintptr_t)block + page - 1) & ~(page - 1);
        const uintptr_t high = ((uintptr_t)block + size) & ~(page - 1);
        /* where it is refused, small pages do */
        (void)madvise((void *)low, high - low, MADV_HUGEPAGE);
    }
    return block;
}
