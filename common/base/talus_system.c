/* What only POSIX provides: signals, clock, host, memory, environment, start-up and exit. */
#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <sys/resource.h>
#include <unistd.h>

void talus_c_signals(int obey, int second_leaves);
int talus_c_signal_seen(void);
int talus_c_signal_checkpoint(void);
double talus_c_wall(void);
int talus_c_pid(void);
void talus_c_host(char *text, int room);
int64_t talus_c_memory_free(void);
int64_t talus_c_memory_resident(void);
int64_t talus_c_memory_most(void);
int talus_c_is_terminal(int fd);
int talus_c_setenv(const char *name, const char *value, int overwrite);
int talus_c_unsetenv(const char *name);
void talus_c_exit(int code);
void talus_c_first_signals(void);
void talus_c_error_text(int error, char *text, int room);

/* A launcher may deliver one request twice (to the group and to each process): what follows the
   first signal within this many seconds is the same request. */
#define SAME_REQUEST 2.0

static volatile sig_atomic_t stop_signal = 0;
static volatile sig_atomic_t checkpoint_signal = 0;
static volatile sig_atomic_t leave_on_second = 0;
static volatile double first_time = 0.0;

static void on_stop(int number)
{
    double now = talus_c_wall();
    if (stop_signal == 0) {
        stop_signal = number;
        first_time = now;
    } else if (leave_on_second && now - first_time > SAME_REQUEST) {
        signal(number, SIG_DFL);
        raise(number);
    }
}

static void on_checkpoint(int number)
{
    (void)number;
    checkpoint_signal = 1;
}

static void handle(int number, void (*handler)(int))
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART | SA_NODEFER;
    sigemptyset(&action.sa_mask);
    sigaction(number, &action, NULL);
}

/* Requests to stop. Who started the program with nohup wants no hang-up to end it. */
static void handle_stops(void (*handler)(int))
{
    struct sigaction before;
    handle(SIGINT, handler);
    handle(SIGTERM, handler);
    handle(SIGQUIT, handler);
    if (sigaction(SIGHUP, NULL, &before) != 0 || before.sa_handler != SIG_IGN) handle(SIGHUP, handler);
}

/* Before all else: a closed pipe or a file over the limit becomes a write error, and a request to
   stop is kept, one that came since the start (talus_start.c held it back) too. */
void talus_c_first_signals(void)
{
    sigset_t none;
    handle(SIGPIPE, SIG_IGN);
    handle(SIGXFSZ, SIG_IGN);
    leave_on_second = 1;
    handle_stops(on_stop);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
}

void talus_c_signals(int obey, int second_leaves)
{
    leave_on_second = second_leaves;
    handle(SIGPIPE, SIG_IGN);
    handle(SIGXFSZ, SIG_IGN);
    handle_stops(obey ? on_stop : SIG_IGN);
    handle(SIGUSR1, obey ? on_checkpoint : SIG_IGN);
    if (!obey) stop_signal = 0;
}

int talus_c_signal_seen(void)
{
    return stop_signal;
}

int talus_c_signal_checkpoint(void)
{
    int seen = checkpoint_signal;
    checkpoint_signal = 0;
    return seen;
}

double talus_c_wall(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int talus_c_pid(void)
{
    return (int)getpid();
}

void talus_c_host(char *text, int room)
{
    if (gethostname(text, (size_t)room) != 0) text[0] = '\0';
    text[room - 1] = '\0';
}

int64_t talus_c_memory_free(void)
{
    char line[128];
    long long kib = -1;
    FILE *f = fopen("/proc/meminfo", "r");
    if (f == NULL) return -1;
    while (fgets(line, sizeof line, f) != NULL)
        if (sscanf(line, "MemAvailable: %lld", &kib) == 1) break;
    fclose(f);
    return kib < 0 ? -1 : (int64_t)kib * 1024;
}

int64_t talus_c_memory_resident(void)
{
    long long whole = 0, resident = -1;
    FILE *f = fopen("/proc/self/statm", "r");
    if (f == NULL) return -1;
    if (fscanf(f, "%lld %lld", &whole, &resident) != 2) resident = -1;
    fclose(f);
    return resident < 0 ? -1 : (int64_t)resident * (int64_t)sysconf(_SC_PAGESIZE);
}

/* The most that was ever resident. getrusage counts what the process had before it became this program,
   a copy of the one that started it: it is asked where there is no /proc. */
int64_t talus_c_memory_most(void)
{
    struct rusage usage;
    char line[128];
    long long kib = -1;
    FILE *f = fopen("/proc/self/status", "r");
    if (f != NULL) {
        while (fgets(line, sizeof line, f) != NULL)
            if (sscanf(line, "VmHWM: %lld", &kib) == 1) break;
        fclose(f);
    }
    if (kib >= 0) return (int64_t)kib * 1024;
    if (getrusage(RUSAGE_SELF, &usage) != 0) return -1;
    return (int64_t)usage.ru_maxrss * 1024;
}

int talus_c_is_terminal(int fd)
{
    return isatty(fd);
}

int talus_c_setenv(const char *name, const char *value, int overwrite)
{
    return setenv(name, value, overwrite);
}

int talus_c_unsetenv(const char *name)
{
    return unsetenv(name);
}

/* exit() runs the end of the Fortran library, which flushes and closes its units. */
void talus_c_exit(int code)
{
    fflush(NULL);
    exit(code);
}

void talus_c_error_text(int error, char *text, int room)
{
    char buffer[256];
    const char *found = strerror_r(error, buffer, sizeof buffer);
    snprintf(text, (size_t)room, "%s", found);
}
