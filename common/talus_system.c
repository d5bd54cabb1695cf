/* What only POSIX can tell: signals, clock, host, memory, environment, start-up and exit. */
#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

void talus_c_signals(int obey, int second_leaves);
int talus_c_signal_seen(void);
int talus_c_signal_checkpoint(void);
double talus_c_wall(void);
int talus_c_pid(void);
void talus_c_host(char *text, int room);
int64_t talus_c_memory_free(void);
int64_t talus_c_memory_resident(void);
int talus_c_is_terminal(int fd);
int talus_c_setenv(const char *name, const char *value, int overwrite);
void talus_c_exit(int code);
int talus_c_blas_kernels(void);
int talus_c_short_spins(void);
void talus_c_write_signals(void);
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

/* A closed pipe or a file over the limit becomes a write error. */
void talus_c_write_signals(void)
{
    handle(SIGPIPE, SIG_IGN);
    handle(SIGXFSZ, SIG_IGN);
}

void talus_c_signals(int obey, int second_leaves)
{
    leave_on_second = second_leaves;
    talus_c_write_signals();
    handle(SIGINT, obey ? on_stop : SIG_IGN);
    handle(SIGTERM, obey ? on_stop : SIG_IGN);
    handle(SIGUSR1, obey ? on_checkpoint : SIG_IGN);
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

int talus_c_is_terminal(int fd)
{
    return isatty(fd);
}

int talus_c_setenv(const char *name, const char *value, int overwrite)
{
    return setenv(name, value, overwrite);
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

/* The words of /proc/self/cmdline as an argv; NULL when it cannot be read. */
static char **own_arguments(void)
{
    size_t room = 4096, used = 0, got, count = 0, k;
    char *text = malloc(room + 1), **words;
    FILE *f = fopen("/proc/self/cmdline", "r");
    if (text == NULL || f == NULL) goto failed;
    while ((got = fread(text + used, 1, room - used, f)) > 0) {
        used += got;
        if (used == room) {
            char *more = realloc(text, 2 * room + 1);
            if (more == NULL) goto failed;
            text = more;
            room *= 2;
        }
    }
    fclose(f);
    f = NULL;
    text[used] = '\0';
    for (k = 0; k < used; k++) count += text[k] == '\0';
    words = calloc(count + 1, sizeof *words);
    if (words == NULL || count == 0) goto failed;
    words[0] = text;
    for (k = 0, count = 1; k + 1 < used; k++)
        if (text[k] == '\0') words[count++] = text + k + 1;
    return words;
failed:
    if (f != NULL) fclose(f);
    free(text);
    return NULL;
}

/* OpenBLAS chooses its kernels when it is loaded, so the choice needs a fresh start of the program.
   Returns 0 when nothing had to be done, otherwise the error that kept the old kernels. */
/* Set a variable of the environment and start this program anew with the same arguments; comes back
   with an error number when that is not possible. */
static int start_again(const char *name, const char *value)
{
    char **words = own_arguments();
    if (words == NULL) return errno != 0 ? errno : ENOMEM;
    setenv(name, value, 1);
    execv("/proc/self/exe", words);
    free(words[0]);
    free(words);
    return errno;
}

int talus_c_blas_kernels(void)
{
    const char *kernels = NULL;
    if (getenv("OPENBLAS_CORETYPE") != NULL) return 0;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        kernels = "SkylakeX";
    else if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        kernels = "Haswell";
#endif
    return kernels == NULL ? 0 : start_again("OPENBLAS_CORETYPE", kernels);
}

int talus_c_short_spins(void)
{
    if (getenv("OMP_WAIT_POLICY") != NULL || getenv("GOMP_SPINCOUNT") != NULL) return 0;
    return start_again("GOMP_SPINCOUNT", "1000");
}
