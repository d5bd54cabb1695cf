/* Start, watch and end child processes. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

int talus_process_spawn(const char *arguments, int count, const char *edits, int edit_count,
                        const char *folder, const char *log, int death_signal, int *code);
int talus_process_open(int pid);
int talus_process_wait(int pid, int fd, int milliseconds, int *exit_code, int *signal_number);
int talus_process_kill_group(int pid, int signal_number);
void talus_process_close(int fd);
void talus_process_sibling(const char *name, char *path, int room);
void talus_process_core_type(char *text, int room);

/* `count` strings, each ended by a zero byte, one behind the other, as an array ended by NULL. */
static char **split(const char *text, int count)
{
    char **list = calloc((size_t)count + 1, sizeof *list);
    for (int k = 0; list && k < count; k++) {
        list[k] = (char *)(uintptr_t)text;
        text += strlen(text) + 1;
    }
    return list;
}

static int starts(const char *text, const char *head)
{
    return strncmp(text, head, strlen(head)) == 0;
}

/* What a parent MPI launcher left: a child that inherits it considers itself one of its ranks. */
static int of_launcher(const char *entry)
{
    if (starts(entry, "OMPI_ALLOW_RUN_AS_ROOT"))
        return 0;
    if (starts(entry, "OMPI_MCA_"))
        return getenv("OMPI_COMM_WORLD_SIZE") != NULL;
    return starts(entry, "OMPI_") || starts(entry, "PMI_") || starts(entry, "PMIX_") ||
           starts(entry, "PMI2_") || starts(entry, "MPI_LOCAL") || starts(entry, "HYDRA_");
}

static int edited(const char *entry, char **edit, int edit_count)
{
    const char *equal = strchr(entry, '=');
    const size_t n = equal ? (size_t)(equal - entry) + 1 : strlen(entry);
    for (int k = 0; k < edit_count; k++)
        if (strncmp(entry, edit[k], n) == 0)
            return 1;
    return 0;
}

static char **environment(char **edit, int edit_count)
{
    size_t n = 0, m = 0;
    while (environ[n])
        n++;
    char **list = calloc(n + (size_t)edit_count + 1, sizeof *list);
    if (!list)
        return NULL;
    for (size_t k = 0; k < n; k++)
        if (!of_launcher(environ[k]) && !edited(environ[k], edit, edit_count))
            list[m++] = environ[k];
    for (int k = 0; k < edit_count; k++)
        list[m++] = edit[k];
    return list;
}

static void become(char **argument, char **variables, const char *folder, const char *log,
                   int death_signal, pid_t parent)
{
    sigset_t none;

    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, death_signal);
    if (death_signal != 0 && getppid() != parent) /* it died before the line above took effect */
        _exit(127);
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
    signal(SIGQUIT, SIG_DFL);
    signal(SIGHUP, SIG_DFL);
    signal(SIGPIPE, SIG_DFL);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    if (*folder && chdir(folder) != 0)
        return;
    const int in = open("/dev/null", O_RDONLY);
    if (in >= 0)
        dup2(in, 0);
    if (in > 2)
        close(in);
    if (*log) {
        const int out = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0666);
        if (out < 0 || dup2(out, 1) < 0 || dup2(out, 2) < 0)
            return;
        if (out > 2)
            close(out);
    }
    environ = variables;
    execvp(argument[0], argument);
}

/* Process number of the child, or 0 with the system's error number in *code. */
int talus_process_spawn(const char *arguments, int count, const char *edits, int edit_count,
                        const char *folder, const char *log, int death_signal, int *code)
{
    int report[2];
    char **argument = split(arguments, count), **edit = split(edits, edit_count);
    char **variables = argument && edit ? environment(edit, edit_count) : NULL;
    const pid_t parent = getpid();
    pid_t pid = -1;

    *code = ENOMEM;
    if (variables && pipe2(report, O_CLOEXEC) == 0) {
        fflush(NULL);
        pid = fork();
        if (pid == 0) {
            become(argument, variables, folder, log, death_signal, parent);
            const int why = errno;
            if (write(report[1], &why, sizeof why) != (ssize_t)sizeof why)
                _exit(126);
            _exit(127);
        }
        *code = pid < 0 ? errno : 0;
        if (pid > 0)
            setpgid(pid, pid); /* both sides do it: no moment without the group */
        close(report[1]);
        int why = 0;
        ssize_t n;
        do
            n = read(report[0], &why, sizeof why);
        while (n < 0 && errno == EINTR);
        close(report[0]);
        if (pid > 0 && n == (ssize_t)sizeof why) { /* exec failed */
            *code = why;
            waitpid(pid, NULL, 0);
            pid = -1;
        }
    }
    free(variables);
    free(edit);
    free(argument);
    return pid > 0 ? (int)pid : 0;
}

int talus_process_open(int pid)
{
    return (int)syscall(SYS_pidfd_open, pid, 0);
}

/* 1 when the child has ended (it is then reaped), 0 when it still runs, -1 when it is unknown. */
int talus_process_wait(int pid, int fd, int milliseconds, int *exit_code, int *signal_number)
{
    siginfo_t info = {0};
    struct pollfd p = {.fd = fd, .events = POLLIN};

    if (fd >= 0)
        poll(&p, 1, milliseconds);
    if (waitid(P_PID, (id_t)pid, &info, WEXITED | (milliseconds < 0 ? 0 : WNOHANG)) != 0)
        return errno == EINTR ? 0 : -1;
    if (info.si_pid == 0)
        return 0;
    *exit_code = info.si_code == CLD_EXITED ? info.si_status : -1;
    *signal_number = info.si_code == CLD_EXITED ? 0 : info.si_status;
    return 1;
}

int talus_process_kill_group(int pid, int signal_number)
{
    return kill(-pid, signal_number) == 0 ? 0 : errno;
}

void talus_process_close(int fd)
{
    if (fd >= 0)
        close(fd);
}

/* Path of a program beside this one; its bare name when there is none. */
void talus_process_sibling(const char *name, char *path, int room)
{
    const ssize_t n = readlink("/proc/self/exe", path, (size_t)room - 1);
    path[n > 0 ? n : 0] = '\0';
    char *slash = strrchr(path, '/');
    const size_t used = slash ? (size_t)(slash - path) + 1 : 0;
    snprintf(path + used, (size_t)room - used, "%s", name);
    if (access(path, X_OK) != 0)
        snprintf(path, (size_t)room, "%s", name);
}

/* Kernels that OpenBLAS should use where it does not recognise the processor (older releases). */
void talus_process_core_type(char *text, int room)
{
    const char *kernels = "";
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl"))
        kernels = "SkylakeX";
    else if (__builtin_cpu_supports("avx2"))
        kernels = "Haswell";
#endif
    snprintf(text, (size_t)room, "%s", getenv("OPENBLAS_CORETYPE") ? "" : kernels);
}
