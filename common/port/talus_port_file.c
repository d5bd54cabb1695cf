/* Files of the hdf5 transport: waiting for a name to appear, small texts, heartbeats, clean-up. */
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
    const int fd = open(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
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
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return -1;
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
    if (mkdir(part, 0777) != 0 && errno != EEXIST)
        return errno;
    if (stat(part, &file) != 0)
        return errno;
    return S_ISDIR(file.st_mode) ? 0 : ENOTDIR;
}

/* Remove the files of one side; with keep_messages all but the messages. */
void talus_file_clear(const char *folder, const char *prefix, int keep_messages)
{
    char path[4096];
    const size_t n = strlen(prefix);
    DIR *d = opendir(folder);

    if (!d)
        return;
    for (struct dirent *entry = readdir(d); entry; entry = readdir(d)) {
        const size_t length = strlen(entry->d_name);
        const int message = length > 3 && strcmp(entry->d_name + length - 3, ".h5") == 0;
        if (strncmp(entry->d_name, prefix, n) != 0 || (message && keep_messages))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        unlink(path);
    }
    closedir(d);
}

void talus_file_remove_folder(const char *path)
{
    rmdir(path);
}
