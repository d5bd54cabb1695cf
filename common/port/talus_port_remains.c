/* What a killed talus-couple leaves at its ports, and who removes it.

   A solver watches the process of its talus-couple from a thread of its own: once that has ended,
   the thread removes the run's segments and the port's folder at once, whatever the solver does just
   then, and ends the solver if talus-couple had started it. What is left where no solver was there
   yet is removed by the next run. */
#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { ROOM = 4096, EXIT_SYSTEM = 4, DAY = 86400 };

void talus_remains_sweep(const char *folder);
void talus_remains_watch(int pid, const char *segment, const char *folder, int keep_messages);
int talus_remains_orphaned(void);
int talus_shm_unlocked(const char *name);
int talus_file_read(const char *path, char *text, int room);
void talus_file_clear(const char *folder, const char *prefix, int keep_messages);
int talus_partner_lives(const char *place, int pid, int64_t started);
void talus_partner_place(char *text, int room);

static void for_each(const char *where, const char *head,
                     void (*action)(const char *, const char *))
{
    DIR *folder = opendir(where);
    if (!folder)
        return;
    for (struct dirent *entry = readdir(folder); entry; entry = readdir(folder))
        if (strncmp(entry->d_name, head, strlen(head)) == 0)
            action(where, entry->d_name);
    closedir(folder);
}

static int no_such_process(long pid)
{
    return pid > 1 && kill((pid_t)pid, 0) != 0 && errno == ESRCH;
}

/* Number of the process in talus-NUMBER-...; 0 when there is none. */
static long maker_of(const char *name)
{
    char *end;
    const long pid = strtol(name + sizeof "talus-" - 1, &end, 10);
    return *end == '-' ? pid : 0;
}

/* A segment that no process locks is left over when its maker has ended, or when it is older than
   ten seconds: between making and locking are microseconds. A maker in another process namespace
   seems to have ended, too: look twice. */
static void remove_segment(const char *where, const char *entry)
{
    const struct timespec moment = {.tv_sec = 0, .tv_nsec = 2000000};
    char path[ROOM], name[ROOM];
    struct stat file;

    snprintf(path, sizeof path, "%s/%s", where, entry);
    snprintf(name, sizeof name, "/%s", entry);
    if (stat(path, &file) != 0 || !talus_shm_unlocked(name) ||
        (file.st_ctime + 10 > time(NULL) && !no_such_process(maker_of(entry))))
        return;
    nanosleep(&moment, NULL);
    if (talus_shm_unlocked(name))
        shm_unlink(name);
}

/* Does a port's folder belong to a run that still goes on? couple.run says whose it is; one made in
   another place counts as dead after a day without a sign. */
static int in_use(const char *folder, const char *entry, int *keep_messages)
{
    char path[ROOM], text[1024], place[256];
    int pid = 0;
    long long started = 0;
    struct stat file;

    *keep_messages = 1;
    if (snprintf(path, sizeof path, "%s/couple.run", folder) >= ROOM)
        return 1;
    if (talus_file_read(path, text, sizeof text) <= 0 ||
        sscanf(text, "talus-run 1 %255s %d %lld %d", place, &pid, &started, keep_messages) != 4)
        return !no_such_process(maker_of(entry)); /* killed before it had written it */
    const int lives = talus_partner_lives(place, pid, started);
    if (lives >= 0)
        return lives;
    snprintf(path, sizeof path, "%.*s/couple.beat", ROOM - 16, folder);
    if (stat(path, &file) != 0 && stat(folder, &file) != 0)
        return 1;
    return file.st_mtime + DAY > time(NULL);
}

static void remove_port(const char *where, const char *entry)
{
    char path[ROOM];
    const size_t n = strlen(entry);
    struct stat file;
    int keep_messages;

    if (n < 11 || strcmp(entry + n - 5, ".port") != 0 ||
        snprintf(path, sizeof path, "%s/%s", where, entry) >= ROOM || lstat(path, &file) != 0 ||
        !S_ISDIR(file.st_mode) || in_use(path, entry, &keep_messages))
        return;
    talus_file_clear(path, "", keep_messages);
    rmdir(path);
}

/* A rendezvous file, NUMBER-HASH.SIDE.port, of a process of this machine that has ended. */
static void remove_rendezvous(const char *where, const char *entry)
{
    char path[ROOM], text[1024], place[256], here[128], side[8];
    int pid = 0, length = 0;

    if (sscanf(entry, "%d-%*16[0-9A-F].%7[a-z].port%n", &pid, side, &length) != 2 ||
        (size_t)length != strlen(entry) || !no_such_process(pid) ||
        snprintf(path, sizeof path, "%s/%s", where, entry) >= ROOM ||
        talus_file_read(path, text, sizeof text) <= 0 ||
        sscanf(text, "%*[^\n]\n%*[^\n]\n%255s", place) != 1)
        return;
    talus_partner_place(here, sizeof here);
    if (strcmp(place, here) == 0)
        unlink(path);
}

/* Remove what dead runs have left: segments, and ports in a folder of results. */
void talus_remains_sweep(const char *folder)
{
    for_each("/dev/shm", "talus-", remove_segment);
    for_each(folder, "talus-", remove_port);
    for_each(folder, "", remove_rendezvous);
}

struct watch {
    int fd, ends, keep_messages;
    char segment[256], folder[ROOM];
};

static void remove_now(const char *where, const char *entry)
{
    char name[ROOM];
    (void)where;
    snprintf(name, sizeof name, "/%s", entry);
    shm_unlink(name);
}

static void *watch(void *given)
{
    static const char said[] = "error P001: talus-couple has ended\n";
    struct watch *w = given;
    struct pollfd p = {.fd = w->fd, .events = POLLIN};
    char *side;

    while (w->fd >= 0 && poll(&p, 1, -1) < 0 && errno == EINTR)
        ;
    side = strrchr(w->segment, '-'); /* /talus-RUN-SIDE: the segments of all sides */
    if (strncmp(w->segment, "/talus-", 7) == 0 && side > w->segment + 7) {
        side[1] = '\0';
        for_each("/dev/shm", w->segment + 1, remove_now);
    }
    if (w->folder[0]) {
        talus_file_clear(w->folder, "", w->keep_messages);
        rmdir(w->folder);
    }
    if (w->ends) {
        if (write(2, said, sizeof said - 1) < 0)
            _exit(EXIT_SYSTEM);
        _exit(EXIT_SYSTEM);
    }
    free(w);
    return NULL;
}

/* The process of talus-couple that has started this one; 0: somebody else has. */
static int parent(void)
{
    const char *text = getenv("TALUS_PARENT");
    return text ? atoi(text) : 0;
}

/* Watch talus-couple, a process of this machine, from now on. Its port is a segment or a folder,
   the other is ''. */
void talus_remains_watch(int pid, const char *segment, const char *folder, int keep_messages)
{
    struct watch *w = calloc(1, sizeof *w);
    sigset_t all, before;
    pthread_t thread;

    if (!w)
        return;
    w->fd = (int)syscall(SYS_pidfd_open, pid, 0);
    w->ends = parent() == pid;
    w->keep_messages = keep_messages;
    snprintf(w->segment, sizeof w->segment, "%s", segment);
    snprintf(w->folder, sizeof w->folder, "%s", folder);
    if (w->fd < 0 && errno != ESRCH) { /* a kernel without it: the port itself notices the end */
        free(w);
        return;
    }
    sigfillset(&all); /* signals are for the other threads */
    pthread_sigmask(SIG_BLOCK, &all, &before);
    if (pthread_create(&thread, NULL, watch, w) == 0)
        pthread_detach(thread);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

/* 1 when talus-couple had started this process and has ended. */
int talus_remains_orphaned(void)
{
    return parent() > 1 && getppid() != parent();
}
