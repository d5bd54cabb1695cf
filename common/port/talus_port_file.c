/* Files of the hdf5 transport: waiting for a name to appear, small texts, heartbeats, clean-up.

   A message file ends with a seal behind what HDF5 has written: mark, bytes before it, their
   CRC-64. HDF5 does not mind it, and a damaged file is refused before HDF5 sees it. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

int talus_file_wait(const char *path, double slice);
int talus_file_write(const char *path, const char *text);
int talus_file_read(const char *path, char *text, int room);
int talus_file_publish(const char *temporary, const char *path);
void talus_file_remove(const char *path);
int talus_file_make_folder(const char *path);
void talus_file_clear(const char *folder, const char *prefix, int keep_messages);
int talus_file_seal(const char *path);
int talus_file_check(const char *path);
uint64_t talus_crc64_bytes(const void *data, int64_t bytes, uint64_t before);
void talus_file_remove_folder(const char *path);

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Reading the folder makes a network file system forget that the name was not there. */
static void refresh(const char *path)
{
    char folder[4096];
    const char *slash = strrchr(path, '/');
    if (!slash || (size_t)(slash - path) >= sizeof folder)
        return;
    memcpy(folder, path, (size_t)(slash - path));
    folder[slash - path] = '\0';
    DIR *d = opendir(folder);
    if (d) {
        (void)readdir(d);
        closedir(d);
    }
}

/* Wait until the file is there, for at most one slice (s); naps from 20 us to 2 ms. */
int talus_file_wait(const char *path, double slice)
{
    const double end = now() + slice;
    long nap = 20000;

    for (;;) {
        if (access(path, F_OK) == 0)
            return 1;
        if (slice <= 0.0 || now() >= end)
            break;
        const struct timespec t = {.tv_sec = 0, .tv_nsec = nap};
        nanosleep(&t, NULL);
        if (nap < 2000000)
            nap += nap / 2;
    }
    if (slice > 0.0)
        refresh(path);
    return access(path, F_OK) == 0;
}

int talus_file_publish(const char *temporary, const char *path)
{
    return rename(temporary, path) == 0 ? 0 : errno;
}

/* Write a small text under a temporary name and rename it: a reader sees all or nothing. */
int talus_file_write(const char *path, const char *text)
{
    char temporary[4096];
    const size_t n = strlen(text);

    snprintf(temporary, sizeof temporary, "%s.tmp", path);
    unlink(temporary); /* of a writer that was killed, or a link of somebody else */
    const int fd = open(temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return errno;
    const ssize_t written = write(fd, text, n);
    const int why = written == (ssize_t)n ? 0 : (written < 0 ? errno : ENOSPC);
    if (close(fd) != 0 && why == 0)
        return errno;
    return why ? why : talus_file_publish(temporary, path);
}

/* Bytes read (text ends with a zero byte), -1 when the file is not there. */
int talus_file_read(const char *path, char *text, int room)
{
    text[0] = '\0';
    struct stat file;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return -1;
    if (fstat(fd, &file) != 0 || !S_ISREG(file.st_mode)) {
        close(fd);
        return -1;
    }
    const ssize_t n = read(fd, text, (size_t)room - 1);
    close(fd);
    text[n > 0 ? n : 0] = '\0';
    return (int)n;
}

void talus_file_remove(const char *path)
{
    unlink(path);
}

int talus_file_make_folder(const char *path)
{
    char part[4096];
    struct stat file;

    snprintf(part, sizeof part, "%s", path);
    for (char *c = part + 1; *c; c++)
        if (*c == '/') {
            *c = '\0';
            if (mkdir(part, 0777) != 0 && errno != EEXIST)
                return errno;
            *c = '/';
        }
    if (mkdir(part, 0700) != 0 && errno != EEXIST) /* what is in it is of this user alone */
        return errno;
    if (stat(part, &file) != 0)
        return errno;
    return S_ISDIR(file.st_mode) ? 0 : ENOTDIR;
}

/* Whether a name ends like this; *length is then shorter by that. */
static int ends(const char *name, size_t *length, const char *ending)
{
    const size_t n = strlen(ending);
    if (*length <= n || strncmp(name + *length - n, ending, n) != 0)
        return 0;
    *length -= n;
    return 1;
}

enum kind { FOREIGN, NOTE, MESSAGE };

/* What a file in a port's folder is: SIDE.port, .joined, .beat, couple.run, SIDE.NUMBER.request.h5,
   .reply.h5, or one of them unfinished. */
static enum kind kind_of(const char *name)
{
    size_t n = strlen(name), digits;
    const int unfinished = ends(name, &n, ".tmp");
    if (ends(name, &n, ".port") || ends(name, &n, ".joined") || ends(name, &n, ".beat") ||
        ends(name, &n, ".run"))
        return NOTE;
    if (!ends(name, &n, ".request.h5") && !ends(name, &n, ".reply.h5"))
        return FOREIGN;
    for (digits = 0; digits < n && name[n - 1 - digits] >= '0' && name[n - 1 - digits] <= '9';)
        digits++;
    if (digits < 8 || digits + 1 >= n || name[n - 1 - digits] != '.')
        return FOREIGN;
    return unfinished ? NOTE : MESSAGE;
}

/* Remove the files of one side ('' of all); with keep_messages all but the messages. What is not of
   the port stays. */
void talus_file_clear(const char *folder, const char *prefix, int keep_messages)
{
    char path[4096];
    const size_t n = strlen(prefix);
    DIR *d = opendir(folder);

    if (!d)
        return;
    for (struct dirent *entry = readdir(d); entry; entry = readdir(d)) {
        const enum kind kind = kind_of(entry->d_name);
        if (strncmp(entry->d_name, prefix, n) != 0 || kind == FOREIGN ||
            (kind == MESSAGE && keep_messages))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (unlink(path) != 0)
            rmdir(path); /* an empty folder of that name */
    }
    closedir(d);
}

void talus_file_remove_folder(const char *path)
{
    rmdir(path);
}

static const char SEAL[8] = {'T', 'A', 'L', 'U', 'S', 'E', 'N', 'D'};

struct seal {
    char mark[sizeof SEAL];
    int64_t bytes;
    uint64_t crc;
};

/* CRC-64 of the first bytes of a file; 0 or errno. */
static int crc_of_file(int fd, int64_t bytes, uint64_t *crc)
{
    enum { PIECE = 1 << 16 };
    unsigned char buffer[PIECE];

    *crc = 0;
    for (int64_t at = 0; at < bytes;) {
        const size_t wanted = bytes - at < PIECE ? (size_t)(bytes - at) : PIECE;
        const ssize_t n = pread(fd, buffer, wanted, (off_t)at);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? errno : EIO;
        *crc = talus_crc64_bytes(buffer, n, *crc);
        at += n;
    }
    return 0;
}

/* Put the seal behind a closed message file; 0 or errno. */
int talus_file_seal(const char *path)
{
    struct seal seal;
    struct stat file;
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0)
        return errno;
    int why = fstat(fd, &file) == 0 ? 0 : errno;
    memcpy(seal.mark, SEAL, sizeof SEAL);
    seal.bytes = why ? 0 : file.st_size;
    if (!why)
        why = crc_of_file(fd, seal.bytes, &seal.crc);
    if (!why && pwrite(fd, &seal, sizeof seal, file.st_size) != (ssize_t)sizeof seal)
        why = errno ? errno : ENOSPC;
    return close(fd) != 0 && !why ? errno : why;
}

/* 0: as it was sealed, or of a partner that seals nothing; -1 damaged, -2 no file; else errno. */
int talus_file_check(const char *path)
{
    struct seal seal;
    struct stat file;
    uint64_t crc;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return errno;
    int why = fstat(fd, &file) == 0 ? 0 : errno;
    if (!why && !S_ISREG(file.st_mode))
        why = -2;
    const off_t at = why ? 0 : file.st_size - (off_t)sizeof seal;
    if (!why && at >= 0) {
        if (pread(fd, &seal, sizeof seal, at) != (ssize_t)sizeof seal)
            why = EIO;
        else if (memcmp(seal.mark, SEAL, sizeof SEAL) == 0 || seal.bytes == at) {
            why = crc_of_file(fd, at, &crc);
            if (!why && (seal.bytes != at || crc != seal.crc))
                why = -1;
        }
    }
    close(fd);
    return why;
}
