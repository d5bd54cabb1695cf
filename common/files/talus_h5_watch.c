/* A bound on reading texts of any length: where a file is damaged HDF5 may walk its heap of texts
 * for ever, and nothing but the end of the process stops it. Processor time counts, so that a slow
 * disk is no fault. Fault S017,
 * whose message is the caller's.
 *
 * Sources: POSIX setitimer; H5HG in HDF5 1.10, whose loop over a heap goes on by sizes that the
 * file gives. */
#include <signal.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

enum { seconds = 5, exit_input = 1 };

void talus_c_watch_begin(const char *text);
void talus_c_watch_end(void);

static struct sigaction before;
static char last_words[512];

/* Only what a signal handler may call. */
static void give_up(int number)
{
    (void)number;
    if (write(STDERR_FILENO, last_words, strlen(last_words)) < 0) _exit(exit_input);
    _exit(exit_input);
}

static void set_timer(long for_seconds)
{
    struct itimerval timer = {{0, 0}, {for_seconds, 0}};
    setitimer(ITIMER_VIRTUAL, &timer, NULL);
}

/* From here on the process has so many seconds until talus_c_watch_end, or ends with these words. */
void talus_c_watch_begin(const char *text)
{
    struct sigaction action;
    strncpy(last_words, text, sizeof last_words - 1);
    memset(&action, 0, sizeof action);
    action.sa_handler = give_up;
    sigaction(SIGVTALRM, &action, &before);
    set_timer(seconds);
}

void talus_c_watch_end(void)
{
    set_timer(0);
    sigaction(SIGVTALRM, &before, NULL);
}
