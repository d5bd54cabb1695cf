/* 64-bit FNV-1a hash of memory and of files. */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static uint64_t mix(uint64_t hash, const unsigned char *data, size_t count)
{
    for (size_t k = 0; k < count; k++)
        hash = (hash ^ data[k]) * UINT64_C(1099511628211);
    return hash;
}

/* Continues from *hash (start with 0 for the offset basis). */
void talus_c_hash(const unsigned char *data, int64_t count, int64_t *hash)
{
    uint64_t start = *hash == 0 ? UINT64_C(14695981039346656037) : (uint64_t)*hash;
    *hash = (int64_t)mix(start, data, (size_t)count);
}

/* Hash of a whole file; returns 0 or errno. */
int talus_c_hash_file(const char *path, int64_t *hash)
{
    enum { chunk = 1 << 20 };
    FILE *file = fopen(path, "rb");
    if (!file)
        return errno ? errno : EIO;
    unsigned char *buffer = malloc(chunk);
    if (!buffer) {
        fclose(file);
        return ENOMEM;
    }
    uint64_t sum = UINT64_C(14695981039346656037);
    size_t count;
    errno = 0;
    while ((count = fread(buffer, 1, chunk, file)) > 0)
        sum = mix(sum, buffer, count);
    int status = ferror(file) ? (errno ? errno : EIO) : 0;
    free(buffer);
    fclose(file);
    *hash = (int64_t)sum;
    return status;
}
