/* Is the process on the other side of a port still alive, and does it work? */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

double talus_partner_now(void);
void talus_partner_nap(double seconds);
int talus_partner_own_pid(void);
void talus_partner_place(char *text, int room);
void talus_partner_host(char *text, int room);
int talus_partner_open(int pid);
int talus_partner_ended(int fd);
void talus_partner_close(int fd);
int64_t talus_partner_ticks(int pid, char *state);
int64_t talus_partner_started(int pid);
int talus_partner_lives(const char *place, int pid, int64_t started);

double talus_partner_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void talus_partner_nap(double seconds)
{
    struct timespec t;
    t.tv_sec = (time_t)seconds;
    t.tv_nsec = (long)(1e9 * (seconds - (double)t.tv_sec));
    nanosleep(&t, NULL);
}

int talus_partner_own_pid(void)
{
    return (int)getpid();
}

/* Boot id and process namespace: where these agree, a process number means the same process. */
void talus_partner_place(char *text, int room)
{
    char boot[64] = "";
    struct stat ns;
    const int fd = open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);
    if (fd >= 0) {
        const ssize_t n = read(fd, boot, 36);
        boot[n > 0 ? n : 0] = '\0';
        close(fd);
    }
    if (stat("/proc/self/ns/pid", &ns) != 0)
        ns.st_ino = 0;
    snprintf(text, (size_t)room, "%s/%llu", boot, (unsigned long long)ns.st_ino);
}

void talus_partner_host(char *text, int room)
{
    if (gethostname(text, (size_t)room) != 0)
        snprintf(text, (size_t)room, "unknown");
    text[room - 1] = '\0';
}

/* A file descriptor that becomes readable when the process ends; below 0 when there is none. */
int talus_partner_open(int pid)
{
    const long fd = syscall(SYS_pidfd_open, pid, 0);
    return fd < 0 ? -errno : (int)fd;
}

int talus_partner_ended(int fd)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, 0) > 0;
}

void talus_partner_close(int fd)
{
    if (fd >= 0)
        close(fd);
}

/* What /proc/PID/stat says behind the program's name, which may hold blanks and brackets. */
static const char *status_of(int pid, char *text, size_t room)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/stat", pid);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return NULL;
    const ssize_t n = read(fd, text, room - 1);
    close(fd);
    if (n <= 0)
        return NULL;
    text[n] = '\0';
    const char *after = strrchr(text, ')');
    return after ? after + 1 : NULL;
}

/* CPU time of all threads of a process in clock ticks, and its state letter; -1 when unknown. */
int64_t talus_partner_ticks(int pid, char *state)
{
    char text[1024];
    unsigned long user = 0, kernel = 0;
    const char *status = status_of(pid, text, sizeof text);

    *state = '?';
    if (!status || sscanf(status, " %c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", state,
                          &user, &kernel) != 3)
        return -1;
    return (int64_t)(user + kernel);
}

/* When a process started, in clock ticks since the start of the machine; 0 when there is none. */
int64_t talus_partner_started(int pid)
{
    char text[1024], state;
    unsigned long long started = 0;
    const char *status = status_of(pid, text, sizeof text);

    if (!status || sscanf(status, " %c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %*u %*u %*d %*d %*d "
                                  "%*d %*d %*d %llu", &state, &started) != 2)
        return 0;
    return state == 'Z' || state == 'X' ? 0 : (int64_t)started;
}

/* 1: the process that said this of itself lives, 0: it has ended; -1: it is of another machine or
   process namespace. */
int talus_partner_lives(const char *place, int pid, int64_t started)
{
    char here[128];
    talus_partner_place(here, sizeof here);
    if (strcmp(place, here) != 0)
        return -1;
    return talus_partner_started(pid) == started;
}
