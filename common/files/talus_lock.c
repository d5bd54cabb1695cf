/* A file that names the process that writes here, under a lock that the kernel drops at its end. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

int talus_c_lock(const char *path, const char *text, int *fd, char *holder, int room);
void talus_c_unlock(const char *path, int fd);

/* Is the file that was opened still the one of this name? Its holder may have removed it. */
static int same_file(const char *path, int fd)
{
    struct stat opened, named;
    return fstat(fd, &opened) == 0 && stat(path, &named) == 0 && opened.st_ino == named.st_ino
           && opened.st_dev == named.st_dev;
}

/* 0: locked, or (fd -1) the folder supports no locks; 1: another process holds it, which left the
   text in holder. */
int talus_c_lock(const char *path, const char *text, int *fd, char *holder, int room)
{
    size_t size = strlen(text);
    holder[0] = '\0';
    for (;;) {
        *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        if (*fd < 0) return 0;
        if (flock(*fd, LOCK_EX | LOCK_NB) != 0) {
            int held = errno == EWOULDBLOCK;
            ssize_t n = held ? pread(*fd, holder, (size_t)room - 1, 0) : 0;
            holder[n > 0 ? n : 0] = '\0';
            close(*fd);
            *fd = -1;
            return held;
        }
        if (same_file(path, *fd)) break;
        close(*fd);
    }
    if (ftruncate(*fd, 0) != 0 || pwrite(*fd, text, size, 0) != (ssize_t)size) return 0;
    return 0;
}

/* The name is removed first, so that no process locks a file that is about to be removed. */
void talus_c_unlock(const char *path, int fd)
{
    unlink(path);
    close(fd);
}
