/* Shared memory transport of the port: one segment, one slot a direction, all atomics of Talus.

   A message moves in chunks of at most one slot. Each direction has two counters: chunks written
   and chunks taken; the writer may write when they are equal, the reader may read when they are
   not. Who waits spins for SPIN seconds (not when both sides share a core: the partner could not
   run) and then sleeps on the counter's futex (shared between processes, so without the PRIVATE
   flag) for one slice; between slices the caller checks whether the partner runs. A side shows its
   life by an OFD lock on its own byte of the segment. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

enum { ASK = 0, SERVE = 1, PAUSES = 16, TEXT = 128 };
enum { STAGE_OPEN = 1, STAGE_SPACE, STAGE_MAP, STAGE_LOCK, STAGE_ABSENT, STAGE_FOREIGN };
static const double SPIN = 40e-6; /* s; about what a sleep and a wake cost */
static const uint64_t MAGIC = 0x31504D4853534C54u; /* 'TLSSHMP1' */

struct channel {
    _Alignas(64) atomic_uint written;
    atomic_uint reader_sleeps;
    _Alignas(64) atomic_uint taken;
    atomic_uint writer_sleeps;
    _Alignas(64) int64_t total; /* bytes of the message under way */
    int64_t chunk;              /* bytes in the slot */
};

struct side {
    _Alignas(64) atomic_ullong beat;
    atomic_int core; /* where it last waited or wrote */
    _Alignas(64) atomic_uint joined;
    int32_t pid;
    char place[TEXT], host[TEXT];
};

struct control {
    _Atomic uint64_t magic; /* written last */
    int64_t slot;           /* bytes of each of the two slots */
    char run_id[TEXT];
    struct side side[2];
    struct channel channel[2]; /* 0: requests, 1: replies */
};

struct port {
    int fd, me;
    size_t size;
    struct control *control;
    unsigned char *data[2];
    char name[256];
};

struct port *talus_shm_create(const char *name, int64_t slot, const char *run_id,
                              const char *place, const char *host, int *stage, int *code);
struct port *talus_shm_connect(const char *name, const char *place, const char *host, int *stage,
                               int *code);
int talus_shm_write(struct port *p, const void *from, int64_t total, int64_t *done, double slice);
int64_t talus_shm_incoming(struct port *p, double slice);
int talus_shm_read(struct port *p, void *to, int64_t total, int64_t *done, double slice);
int talus_shm_partner(struct port *p, char *place, char *host, int room);
int64_t talus_shm_partner_beat(struct port *p);
int talus_shm_partner_gone(struct port *p);
void talus_shm_run_id(struct port *p, char *text, int room);
void talus_shm_beat(struct port *p);
void talus_shm_close(struct port *p);

static const size_t control_bytes = (sizeof(struct control) + 4095) / 4096 * 4096;

static struct port *fail(struct port *p, int *stage, int *code, int at, int why)
{
    *stage = at;
    *code = why;
    if (p) {
        if (p->control)
            munmap(p->control, p->size);
        if (p->fd >= 0)
            close(p->fd);
        free(p);
    }
    return NULL;
}

static int lock_byte(int fd, int byte, int command, short *type)
{
    struct flock lock = {.l_type = *type, .l_whence = SEEK_SET, .l_start = byte, .l_len = 1};
    const int result = fcntl(fd, command, &lock);
    *type = lock.l_type;
    return result;
}

static int take_lock(struct port *p)
{
    short type = F_WRLCK;
    return lock_byte(p->fd, p->me, F_OFD_SETLK, &type);
}

/* A segment that no process locks and that is older than ten seconds is left over: remove it. */
static void remove_left_over(const char *name)
{
    const int fd = shm_open(name, O_RDWR | O_CLOEXEC, 0);
    struct stat file;
    if (fd < 0)
        return;
    short ask = F_WRLCK, serve = F_WRLCK;
    if (fstat(fd, &file) == 0 && file.st_ctime + 10 < time(NULL) &&
        lock_byte(fd, ASK, F_OFD_GETLK, &ask) == 0 && ask == F_UNLCK &&
        lock_byte(fd, SERVE, F_OFD_GETLK, &serve) == 0 && serve == F_UNLCK)
        shm_unlink(name);
    close(fd);
}

/* A run killed before its solvers joined leaves its segments; the next run removes them. */
static void sweep(void)
{
    DIR *folder = opendir("/dev/shm");
    char name[sizeof(((struct dirent *)0)->d_name) + 1];
    if (!folder)
        return;
    for (struct dirent *entry = readdir(folder); entry; entry = readdir(folder))
        if (strncmp(entry->d_name, "talus-", 6) == 0) {
            snprintf(name, sizeof name, "/%s", entry->d_name);
            remove_left_over(name);
        }
    closedir(folder);
}

static int map(struct port *p)
{
    void *at = mmap(NULL, p->size, PROT_READ | PROT_WRITE, MAP_SHARED, p->fd, 0);
    if (at == MAP_FAILED)
        return -1;
    p->control = at;
    p->data[0] = (unsigned char *)at + control_bytes;
    p->data[1] = p->data[0] + (p->size - control_bytes) / 2;
    return 0;
}

static void sign_in(struct port *p, const char *place, const char *host)
{
    struct side *s = &p->control->side[p->me];
    s->pid = (int32_t)getpid();
    atomic_store(&s->core, -1 - p->me);
    snprintf(s->place, TEXT, "%s", place);
    snprintf(s->host, TEXT, "%s", host);
    atomic_store(&s->joined, 1u);
}

static struct port *new_port(const char *name, int me)
{
    struct port *p = calloc(1, sizeof *p);
    if (p) {
        p->me = me;
        p->fd = -1;
        snprintf(p->name, sizeof p->name, "%s", name);
    }
    return p;
}

struct port *talus_shm_create(const char *name, int64_t slot, const char *run_id,
                              const char *place, const char *host, int *stage, int *code)
{
    struct port *p = new_port(name, ASK);
    if (!p)
        return fail(p, stage, code, STAGE_MAP, ENOMEM);
    sweep();
    p->fd = shm_open(name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (p->fd < 0)
        return fail(p, stage, code, STAGE_OPEN, errno);
    p->size = control_bytes + 2 * (size_t)slot;
    if (take_lock(p) != 0) {
        const int why = errno;
        shm_unlink(name);
        return fail(p, stage, code, STAGE_LOCK, why);
    }
    int why = posix_fallocate(p->fd, 0, (off_t)p->size);
    if (why == 0 && map(p) != 0)
        why = errno;
    if (why != 0) {
        shm_unlink(name);
        return fail(p, stage, code, p->control ? STAGE_MAP : STAGE_SPACE, why);
    }
    p->control->slot = slot;
    snprintf(p->control->run_id, TEXT, "%s", run_id);
    sign_in(p, place, host);
    atomic_store(&p->control->magic, MAGIC);
    *stage = 0;
    *code = 0;
    return p;
}

struct port *talus_shm_connect(const char *name, const char *place, const char *host, int *stage,
                               int *code)
{
    struct port *p = new_port(name, SERVE);
    struct stat file;
    if (!p)
        return fail(p, stage, code, STAGE_MAP, ENOMEM);
    p->fd = shm_open(name, O_RDWR | O_CLOEXEC, 0);
    if (p->fd < 0)
        return fail(p, stage, code, errno == ENOENT ? STAGE_ABSENT : STAGE_OPEN, errno);
    if (fstat(p->fd, &file) != 0)
        return fail(p, stage, code, STAGE_OPEN, errno);
    p->size = (size_t)file.st_size;
    if (p->size <= control_bytes)
        return fail(p, stage, code, STAGE_ABSENT, 0);
    if (map(p) != 0)
        return fail(p, stage, code, STAGE_MAP, errno);
    const uint64_t magic = atomic_load(&p->control->magic);
    if (magic != MAGIC)
        return fail(p, stage, code, magic == 0 ? STAGE_ABSENT : STAGE_FOREIGN, 0);
    if (control_bytes + 2 * (size_t)p->control->slot != p->size)
        return fail(p, stage, code, STAGE_FOREIGN, 0);
    if (take_lock(p) != 0)
        return fail(p, stage, code, STAGE_LOCK, errno);
    sign_in(p, place, host);
    shm_unlink(name); /* both are in: nothing is left behind, whatever happens now */
    *stage = 0;
    *code = 0;
    return p;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void pause_briefly(void)
{
#if defined(__x86_64__)
    _mm_pause();
#endif
}

/* Copy into the slot by streaming stores: lines that one core has changed are slow on another
   (measured: 104 kB in 50 us; by streaming stores in 8 us). Short chunks gain nothing. */
static void copy_out(unsigned char *to, const unsigned char *from, size_t bytes)
{
    size_t k = 0;
#if defined(__x86_64__)
    if (bytes >= 2048) {
        for (; k + 64 <= bytes; k += 64)
            for (size_t j = k; j < k + 64; j += 16)
                _mm_stream_si128((__m128i *)(void *)(to + j),
                                 _mm_loadu_si128((const __m128i *)(const void *)(from + j)));
        _mm_sfence();
    }
#endif
    memcpy(to + k, from + k, bytes - k);
}

static int note_core(struct port *p)
{
    const int core = sched_getcpu();
    atomic_store_explicit(&p->control->side[p->me].core, core, memory_order_relaxed);
    return core;
}

/* Spin until *word differs from `old`; 1 when it does. */
static int spin(struct port *p, atomic_uint *word, unsigned old)
{
    const struct side *other = &p->control->side[1 - p->me];
    if (note_core(p) == atomic_load_explicit(&other->core, memory_order_relaxed))
        return 0;
    const double end = now() + SPIN;
    do
        for (int k = 0; k < PAUSES; k++) {
            if (atomic_load_explicit(word, memory_order_acquire) != old)
                return 1;
            pause_briefly();
        }
    while (now() < end);
    return 0;
}

/* Wait until *word differs from `old`, for at most one slice (s); 1 when it does. */
static int wait_change(struct port *p, atomic_uint *word, unsigned old, atomic_uint *sleeps,
                       double slice)
{
    if (atomic_load_explicit(word, memory_order_acquire) != old)
        return 1;
    if (slice <= 0.0)
        return 0;
    if (spin(p, word, old))
        return 1;
    struct timespec limit = {.tv_sec = (time_t)slice};
    limit.tv_nsec = (long)(1e9 * (slice - (double)limit.tv_sec));
    atomic_store(sleeps, 1u);
    if (atomic_load(word) == old)
        syscall(SYS_futex, (void *)word, FUTEX_WAIT, old, &limit, NULL, 0);
    atomic_store(sleeps, 0u);
    return atomic_load(word) != old;
}

static void bump(atomic_uint *word, unsigned value, atomic_uint *sleeps)
{
    atomic_store(word, value);
    if (atomic_load(sleeps))
        syscall(SYS_futex, (void *)word, FUTEX_WAKE, INT_MAX, NULL, NULL, 0);
}

/* Write on from *done; 0 when all is written, 1 when the slice passed: call again. */
int talus_shm_write(struct port *p, const void *from, int64_t total, int64_t *done, double slice)
{
    struct channel *c = &p->control->channel[p->me];
    const int64_t slot = p->control->slot;

    while (*done < total) {
        const unsigned written = atomic_load_explicit(&c->written, memory_order_relaxed);
        const unsigned taken = atomic_load_explicit(&c->taken, memory_order_acquire);
        if (taken != written && !wait_change(p, &c->taken, taken, &c->writer_sleeps, slice))
            return 1;
        if (atomic_load_explicit(&c->taken, memory_order_acquire) != written)
            continue;
        c->chunk = total - *done < slot ? total - *done : slot;
        c->total = total;
        copy_out(p->data[p->me], (const unsigned char *)from + *done, (size_t)c->chunk);
        *done += c->chunk;
        note_core(p);
        bump(&c->written, written + 1, &c->reader_sleeps);
    }
    return 0;
}

/* Bytes of the message that has begun to arrive; 0 when the slice passed without one. */
int64_t talus_shm_incoming(struct port *p, double slice)
{
    struct channel *c = &p->control->channel[1 - p->me];
    const unsigned taken = atomic_load_explicit(&c->taken, memory_order_relaxed);
    return wait_change(p, &c->written, taken, &c->reader_sleeps, slice) ? c->total : 0;
}

/* Read on from *done; 0 when all is here, 1 when the slice passed, -1 when the counts disagree. */
int talus_shm_read(struct port *p, void *to, int64_t total, int64_t *done, double slice)
{
    struct channel *c = &p->control->channel[1 - p->me];

    while (*done < total) {
        const unsigned taken = atomic_load_explicit(&c->taken, memory_order_relaxed);
        if (!wait_change(p, &c->written, taken, &c->reader_sleeps, slice))
            return 1;
        const int64_t chunk = c->chunk;
        if (chunk <= 0 || chunk > p->control->slot || chunk > total - *done)
            return -1;
        memcpy((unsigned char *)to + *done, p->data[1 - p->me], (size_t)chunk);
        *done += chunk;
        note_core(p);
        bump(&c->taken, taken + 1, &c->writer_sleeps);
    }
    return 0;
}

/* Process number, place and host of the other side; 0 while it has not joined. */
int talus_shm_partner(struct port *p, char *place, char *host, int room)
{
    struct side *s = &p->control->side[1 - p->me];
    if (!atomic_load(&s->joined))
        return 0;
    snprintf(place, (size_t)room, "%.*s", TEXT - 1, s->place);
    snprintf(host, (size_t)room, "%.*s", TEXT - 1, s->host);
    return s->pid;
}

int64_t talus_shm_partner_beat(struct port *p)
{
    return (int64_t)atomic_load_explicit(&p->control->side[1 - p->me].beat, memory_order_relaxed);
}

/* 1 when the other side had joined and its lock has dropped: its process has ended. */
int talus_shm_partner_gone(struct port *p)
{
    short type = F_WRLCK;
    if (!atomic_load(&p->control->side[1 - p->me].joined))
        return 0;
    return lock_byte(p->fd, 1 - p->me, F_OFD_GETLK, &type) == 0 && type == F_UNLCK;
}

void talus_shm_run_id(struct port *p, char *text, int room)
{
    snprintf(text, (size_t)room, "%.*s", TEXT - 1, p->control->run_id);
}

void talus_shm_beat(struct port *p)
{
    atomic_fetch_add_explicit(&p->control->side[p->me].beat, 1u, memory_order_relaxed);
}

void talus_shm_close(struct port *p)
{
    if (p->me == ASK && !atomic_load(&p->control->side[SERVE].joined))
        shm_unlink(p->name);
    munmap(p->control, p->size);
    close(p->fd);
    free(p);
}
