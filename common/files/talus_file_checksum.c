/* CRC-64 of a file behind its first 512 bytes, which hold it: HDF5 leaves them to the user. */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { block = 512, chunk = 1 << 18 };
static const char mark[] = "talus-checksum 1\n";

uint64_t talus_crc64_bytes(const void *data, int64_t bytes, uint64_t before);
int talus_c_write_checksum(const char *path);
int talus_c_check_checksum(const char *path, int *found, int64_t sizes[2], int64_t sums[2]);

/* Reads up to size bytes at a place; fewer at the end of the file, negative errno after a fault. */
static int64_t read_at(int fd, unsigned char *buffer, size_t size, int64_t place)
{
    size_t done = 0;
    while (done < size) {
        ssize_t got = pread(fd, buffer + done, size - done, (off_t)(place + (int64_t)done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return -(int64_t)errno;
        if (got == 0) break;
        done += (size_t)got;
    }
    return (int64_t)done;
}

/* Checksum and size of all behind the block; returns 0 or errno. */
static int sum_of(int fd, uint64_t *sum, int64_t *size)
{
    unsigned char *buffer = malloc(chunk);
    int64_t got;
    if (buffer == NULL) return ENOMEM;
    *sum = 0;
    *size = 0;
    (void)posix_fadvise(fd, 0, 0, POSIX_FADV_SEQUENTIAL);
    while ((got = read_at(fd, buffer, chunk, block + *size)) > 0) {
        *sum = talus_crc64_bytes(buffer, got, *sum);
        *size += got;
    }
    free(buffer);
    return got < 0 ? (int)-got : 0;
}

/* A block, damaged or not: most of its mark is there. */
static int has_mark(const char *text)
{
    size_t k, same = 0;
    for (k = 0; k < sizeof mark - 1; k++)
        same += text[k] == mark[k];
    return same > (sizeof mark - 1) / 2;
}

/* What the block says of this checksum and size, padded by zeros. */
static void fill_block(char text[block], uint64_t sum, int64_t size)
{
    memset(text, 0, block);
    (void)snprintf(text, block, "%scrc64 %016" PRIx64 "\nbytes %" PRId64 "\n", mark, sum, size);
}

/* Writes the block of a closed file that has room for it; returns 0 or errno. */
int talus_c_write_checksum(const char *path)
{
    char text[block];
    uint64_t sum = 0;
    int64_t size = 0;
    ssize_t put;
    int error, fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0) return errno;
    /* the disk begins to write while the checksum is found */
    (void)sync_file_range(fd, 0, 0, SYNC_FILE_RANGE_WRITE);
    error = sum_of(fd, &sum, &size);
    if (error == 0) {
        fill_block(text, sum, size);
        put = pwrite(fd, text, block, 0);
        if (put != block) error = put < 0 ? errno : ENOSPC;
    }
    if (close(fd) != 0 && error == 0) error = errno;
    return error;
}

/* found: 1 the file begins with a block, 0 with none. sizes, sums: what the block says and what
   there is; where the block itself is damaged, it says -1. Returns 0 or errno. */
int talus_c_check_checksum(const char *path, int *found, int64_t sizes[2], int64_t sums[2])
{
    char text[block + 1] = {0}, whole[block];
    uint64_t sum = 0, said = 0;
    int64_t got;
    int error = 0, fd = open(path, O_RDONLY | O_CLOEXEC);
    *found = 0;
    if (fd < 0) return errno;
    got = read_at(fd, (unsigned char *)text, block, 0);
    if (got < 0) error = (int)-got;
    if (error == 0 && has_mark(text)) {
        *found = 1;
        if (sscanf(text + sizeof mark - 1, "crc64 %16" SCNx64 " bytes %18" SCNd64, &said,
                   &sizes[0]) != 2)
            sizes[0] = -1;
        error = sum_of(fd, &sum, &sizes[1]);
        fill_block(whole, said, sizes[0]);
        if (memcmp(text, whole, block) != 0) sizes[0] = -1;
        sums[0] = (int64_t)said;
        sums[1] = (int64_t)sum;
    }
    if (close(fd) != 0 && error == 0) error = errno;
    return error;
}
