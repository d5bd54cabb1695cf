/* Files and folders by POSIX: every call returns 0 or errno, so that a full disk is seen. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

int talus_c_mkdirs(const char *path);
int talus_c_rename(const char *from, const char *to);
int talus_c_link(const char *from, const char *to);
int talus_c_unlink(const char *path);
int talus_c_rmdir(const char *path);
int talus_c_sync_path(const char *path);
int talus_c_stat(const char *path, int64_t *size, double *changed, int *is_folder);
int talus_c_is_plain(const char *path);
int talus_c_same_file(const char *a, const char *b);
int talus_c_writable(const char *folder);
int64_t talus_c_disk_free(const char *folder);
int talus_c_open_append(const char *path, int fresh, int *fd);
int talus_c_write(int fd, const char *data, int64_t size);
int talus_c_close(int fd, int sync);
int talus_c_truncate(const char *path, int64_t size);
int talus_c_reserve(const char *path, int64_t bytes);
int talus_c_list(const char *folder, const char *prefix, char **text, int64_t *size);
void talus_c_free(char *text);

int talus_c_mkdirs(const char *path)
{
    size_t n = strlen(path), k;
    struct stat st;
    char *part = malloc(n + 1);
    int error = 0;
    if (part == NULL) return ENOMEM;
    memcpy(part, path, n + 1);
    for (k = 1; k <= n; k++) {
        if (part[k] != '/' && part[k] != '\0') continue;
        part[k] = '\0';
        if (mkdir(part, 0777) != 0 && errno != EEXIST) {
            error = errno;
            break;
        }
        part[k] = k < n ? '/' : '\0';
    }
    free(part);
    if (error == 0 && stat(path, &st) == 0 && !S_ISDIR(st.st_mode)) error = ENOTDIR;
    return error;
}

int talus_c_rename(const char *from, const char *to)
{
    return rename(from, to) == 0 ? 0 : errno;
}

int talus_c_link(const char *from, const char *to)
{
    return link(from, to) == 0 ? 0 : errno;
}

int talus_c_unlink(const char *path)
{
    return unlink(path) == 0 ? 0 : errno;
}

int talus_c_rmdir(const char *path)
{
    return rmdir(path) == 0 ? 0 : errno;
}

/* fsync of a file or a folder; file systems that cannot sync a folder are forgiven. */
int talus_c_sync_path(const char *path)
{
    int error = 0, fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) return errno;
    if (fsync(fd) != 0 && errno != EINVAL && errno != ENOTSUP && errno != EROFS) error = errno;
    if (close(fd) != 0 && error == 0) error = errno;
    return error;
}

int talus_c_stat(const char *path, int64_t *size, double *changed, int *is_folder)
{
    struct stat st;
    if (stat(path, &st) != 0) return errno;
    *size = (int64_t)st.st_size;
    *changed = (double)st.st_mtim.tv_sec + 1e-9 * (double)st.st_mtim.tv_nsec;
    *is_folder = S_ISDIR(st.st_mode) ? 1 : 0;
    return 0;
}

int talus_c_is_plain(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

int talus_c_same_file(const char *a, const char *b)
{
    struct stat st_a, st_b;
    if (stat(a, &st_a) != 0 || stat(b, &st_b) != 0) return 0;
    return st_a.st_dev == st_b.st_dev && st_a.st_ino == st_b.st_ino;
}

int talus_c_writable(const char *folder)
{
    return access(folder, W_OK | X_OK) == 0 ? 0 : errno;
}

int64_t talus_c_disk_free(const char *folder)
{
    struct statvfs st;
    if (statvfs(folder, &st) != 0) return -1;
    return (int64_t)st.f_bavail * (int64_t)st.f_frsize;
}

int talus_c_open_append(const char *path, int fresh, int *fd)
{
    int flags = O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | (fresh ? O_TRUNC : 0);
    *fd = open(path, flags, 0666);
    return *fd < 0 ? errno : 0;
}

int talus_c_write(int fd, const char *data, int64_t size)
{
    int64_t done = 0;
    while (done < size) {
        ssize_t n = write(fd, data + done, (size_t)(size - done));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno;
        done += n;
    }
    return 0;
}

int talus_c_close(int fd, int sync)
{
    int error = 0;
    if (sync && fsync(fd) != 0 && errno != EINVAL && errno != ENOTSUP) error = errno;
    if (close(fd) != 0 && error == 0) error = errno;
    return error;
}

int talus_c_truncate(const char *path, int64_t size)
{
    return truncate(path, (off_t)size) == 0 ? 0 : errno;
}

/* Room for so many bytes behind the end of a file, whose size stays. Where the file system cannot
   reserve, what is free must do. */
int talus_c_reserve(const char *path, int64_t bytes)
{
    struct rlimit most;
    struct stat st;
    struct statvfs disk;
    int error = 0, fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0) return errno;
    if (fstat(fd, &st) != 0) {
        error = errno;
    } else if (getrlimit(RLIMIT_FSIZE, &most) == 0 && most.rlim_cur != RLIM_INFINITY &&
               (rlim_t)(st.st_size + bytes) > most.rlim_cur) {
        error = EFBIG;
    } else if (fallocate(fd, FALLOC_FL_KEEP_SIZE, st.st_size, (off_t)bytes) != 0) {
        error = errno;
        if (error == EOPNOTSUPP || error == ENOSYS || error == EINVAL || error == EINTR)
            error = fstatvfs(fd, &disk) == 0 &&
                            (int64_t)disk.f_bavail * (int64_t)disk.f_frsize < bytes ? ENOSPC : 0;
    }
    if (close(fd) != 0 && error == 0) error = errno;
    return error;
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name);
}

/* Names in a folder that begin with the prefix, sorted, each followed by a newline. */
int talus_c_list(const char *folder, const char *prefix, char **text, int64_t *size)
{
    struct dirent **entry = NULL;
    size_t used = 0, room = 1, head = strlen(prefix);
    int k, count = scandir(folder, &entry, NULL, by_name);
    *text = NULL;
    *size = 0;
    if (count < 0) return errno;
    for (k = 0; k < count; k++) room += strlen(entry[k]->d_name) + 1;
    *text = malloc(room);
    for (k = 0; k < count; k++) {
        const char *name = entry[k]->d_name;
        size_t n = strlen(name);
        if (*text != NULL && strncmp(name, prefix, head) == 0 && strcmp(name, ".") != 0
            && strcmp(name, "..") != 0) {
            memcpy(*text + used, name, n);
            (*text)[used + n] = '\n';
            used += n + 1;
        }
        free(entry[k]);
    }
    free(entry);
    *size = (int64_t)used;
    return *text == NULL ? ENOMEM : 0;
}

void talus_c_free(char *text)
{
    free(text);
}
