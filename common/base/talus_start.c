/*
 * Variables of the environment that libraries read once, when they are loaded: they are set by
 * restarting the program before any library has begun. Later would be too late in another way
 * too: by then OpenMP has bound the first thread to its place (OMP_PROC_BIND), and the program that
 * is restarted would inherit that one core for all its threads.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

int talus_c_blas_kernels(void);
int talus_c_short_spins(void);

enum { MOST = 3 }; /* settings, and the end of the list */

static int start_error;

/* OpenBLAS chooses old kernels for unknown processors: the best that this one runs. */
__attribute__((no_sanitize("address", "undefined"))) static const char *kernels(void)
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
        return "OPENBLAS_CORETYPE=SkylakeX";
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        return "OPENBLAS_CORETYPE=Haswell";
#endif
    return NULL;
}

__attribute__((no_sanitize("address", "undefined"))) static int has(char **list, const char *name)
{
    for (; *list != NULL; list++) {
        size_t k = 0;
        while (name[k] != '\0' && (*list)[k] == name[k]) k++;
        if (name[k] == '\0' && (*list)[k] == '=') return 1;
    }
    return 0;
}

/* Requests to stop wait for the program's first statement, over the restart too. Of programs of ours
   alone: a test does not ask for them. */
__attribute__((no_sanitize("address", "undefined"))) static void hold_signals(const char *name)
{
    sigset_t stops;
    const char *base = name;
    for (const char *c = name; *c != '\0'; c++)
        if (*c == '/') base = c + 1;
    if (base[0] != 't' || base[1] != 'a' || base[2] != 'l' || base[3] != 'u' || base[4] != 's' || base[5] != '-')
        return;
    sigemptyset(&stops);
    sigaddset(&stops, SIGINT);
    sigaddset(&stops, SIGTERM);
    sigaddset(&stops, SIGQUIT);
    sigaddset(&stops, SIGHUP);
    sigprocmask(SIG_BLOCK, &stops, NULL);
}

/* Runs before the constructors of all libraries. */
__attribute__((no_sanitize("address", "undefined"))) static void before_libraries(int argc, char **argv,
                                                                                 char **list)
{
    static char spin[] = "GOMP_SPINCOUNT=1000";
    size_t count = 0, used = 0;
    if (argc > 0) hold_signals(argv[0]);
    const char *core = has(list, "OPENBLAS_CORETYPE") ? NULL : kernels();
    const int spins = !has(list, "OMP_WAIT_POLICY") && !has(list, "GOMP_SPINCOUNT");
    if (argc < 1 || (core == NULL && !spins)) return;
    while (list[count] != NULL) count++;
    char *longer[count + MOST];
    for (; used < count; used++) longer[used] = list[used];
    if (core != NULL) longer[used++] = (char *)core;
    if (spins) longer[used++] = spin;
    longer[used] = NULL;
    execve("/proc/self/exe", argv, longer);
    start_error = errno;
}

__attribute__((section(".preinit_array"), used)) static void (*const first)(int, char **, char **)
    = before_libraries;

/* 0, or the error that kept the settings away. */
int talus_c_blas_kernels(void)
{
    return getenv("OPENBLAS_CORETYPE") != NULL ? 0 : start_error;
}

int talus_c_short_spins(void)
{
    return getenv("OMP_WAIT_POLICY") != NULL || getenv("GOMP_SPINCOUNT") != NULL ? 0 : start_error;
}
