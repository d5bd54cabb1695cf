/* Shared memory transport of the port: one segment, one slot a direction, all atomics of Talus.

   A message moves in chunks of at most one slot. Each direction has two counters: chunks written
   and chunks taken; the writer may write when they are equal, the reader may read when they are
   not. Who waits spins for SPIN seconds (not when both sides share a core: the partner could not
   run) and then sleeps on the counter's futex (shared between processes, so without the PRIVATE
   flag) for one slice; between slices the caller checks whether the partner runs. A side shows its
   life by an OFD lock on its own byte of the segment.

   What decides about the course of the exchange is sealed: a counter has its check beside it in the
   same 64 bits, the byte counts of a chunk and what each side says of itself have their CRC. A side
   keeps its own counters to itself and never reads them back. Heartbeat, core and the notes of
   sleepers are hints: a wrong one costs a slice at most. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <sched.h>
#include <stdatomic.h>
#include <stddef.h>
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

#include "talus_port_shm.h"

enum { ASK = 0, SERVE = 1, PAUSES = 16 };
/* Places of sealed words, each for talus-couple (even) and for the solver (odd). */
enum { WRITTEN = 2, TAKEN = 4, JOINED = 6, STATE = 8, CHUNK = 10, ABOUT = 12 };
/* A state: what it does, and above two bits how often it has slept for it. */
enum { WORKS = 0, WAITS_TO_READ = 1, WAITS_TO_WRITE = 2, SLEPT = 4 };
static const double SPIN = 40e-6; /* s; about what a sleep and a wake cost */
static const uint64_t MAGIC = 0x32504D4853534C54u; /* 'TLSSHMP2' */

struct chunk {
    uint64_t number; /* that `written` has when it is there */
    int64_t total;   /* bytes of the message under way */
    int64_t bytes;   /* in the slot */
    uint64_t crc;    /* of the three */
};

struct channel {
    _Alignas(64) _Atomic uint64_t written;
    atomic_uint reader_sleeps;
    _Alignas(64) _Atomic uint64_t taken;
    atomic_uint writer_sleeps;
    _Alignas(64) struct chunk chunk;
};

struct side {
    _Alignas(64) atomic_ullong beat;
    atomic_int core; /* where it last waited or wrote */
    _Atomic uint64_t state;
    _Alignas(64) _Atomic uint64_t joined; /* process number; 0 before */
    char about[2][TEXT];                  /* place, host */
    uint64_t crc;                         /* of them */
    uint64_t proof;                       /* of them and the run id */
};

struct control {
    _Atomic uint64_t magic; /* written last */
    int64_t slot;           /* bytes of each of the two slots */
    char run_id[TEXT];
    uint64_t crc; /* of the two */
    struct side side[2];
    struct channel channel[2]; /* 0: requests, 1: replies */
};

struct port {
    int fd, me, met;       /* met: the other side has joined */
    int bad_place;         /* of a damaged word, 0 while none was seen */
    int stranger;          /* the other side has not proved the run id */
    uint64_t bad_word;
    unsigned sent, taken;  /* chunks of ours that were written, of the other side that we took */
    unsigned slept;        /* times */
    int64_t slot;
    size_t size;
    struct control *control;
    unsigned char *data[2];
    char name[256], run_id[TEXT];
};

static const size_t control_bytes = (sizeof(struct control) + 4095) / 4096 * 4096;

/* Value in the low half, check of value and place in the high one: up to five flips are seen. */
static uint64_t sealed(unsigned value, int place)
{
    const uint64_t word = (uint64_t)place << 32 | value;
    const uint64_t crc = talus_crc64_bytes(&word, sizeof word, 0);
    return value | (crc ^ crc >> 32) << 32;
}

static int whole(uint64_t word, int place)
{
    return word == sealed((unsigned)word, place);
}

static int damaged(struct port *p, int place, uint64_t word)
{
    p->bad_place = place;
    p->bad_word = word;
    return -1;
}

static uint64_t crc_of_chunk(const struct chunk *chunk)
{
    return talus_crc64_bytes(chunk, offsetof(struct chunk, crc), 0);
}

static uint64_t crc_of_side(const struct side *side)
{
    return talus_crc64_bytes(side->about, sizeof side->about, 0);
}

/* What a side can only write that knows whose run this is. */
static uint64_t proof_of_side(const struct side *side, const char *run_id)
{
    return talus_crc64_bytes(run_id, TEXT, crc_of_side(side));
}

static uint64_t crc_of_control(const struct control *c)
{
    return talus_crc64_bytes(&c->slot, (int64_t)sizeof c->slot + TEXT, 0);
}

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

/* Whether a segment /talus-... is one that no process locks any more. */
int talus_shm_unlocked(const char *name)
{
    const int fd = shm_open(name, O_RDWR | O_CLOEXEC, 0);
    short ask = F_WRLCK, serve = F_WRLCK;
    if (fd < 0)
        return 0;
    const int free_now = lock_byte(fd, ASK, F_OFD_GETLK, &ask) == 0 && ask == F_UNLCK &&
                         lock_byte(fd, SERVE, F_OFD_GETLK, &serve) == 0 && serve == F_UNLCK;
    close(fd);
    return free_now;
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
    atomic_store(&s->core, -1 - p->me);
    atomic_store(&s->state, sealed(WORKS, STATE + p->me));
    snprintf(s->about[0], TEXT, "%s", place);
    snprintf(s->about[1], TEXT, "%s", host);
    s->crc = crc_of_side(s);
    s->proof = proof_of_side(s, p->run_id);
    atomic_store(&s->joined, sealed((unsigned)getpid(), JOINED + p->me));
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
    p->slot = p->control->slot = slot;
    snprintf(p->run_id, TEXT, "%s", run_id);
    memcpy(p->control->run_id, p->run_id, TEXT);
    p->control->crc = crc_of_control(p->control);
    for (int k = 0; k < 2; k++) {
        atomic_store(&p->control->channel[k].written, sealed(0, WRITTEN + k));
        atomic_store(&p->control->channel[k].taken, sealed(0, TAKEN + k));
        atomic_store(&p->control->side[k].state, sealed(WORKS, STATE + k));
    }
    sign_in(p, place, host);
    atomic_store(&p->control->magic, MAGIC);
    *stage = 0;
    *code = 0;
    return p;
}

/* run_id: what the caller was told, empty when it was not. */
struct port *talus_shm_connect(const char *name, const char *run_id, const char *place,
                               const char *host, int *stage, int *code)
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
    if (file.st_uid != geteuid()) /* somebody else waits at this name */
        return fail(p, stage, code, STAGE_OPEN, EPERM);
    p->size = (size_t)file.st_size;
    if (p->size <= control_bytes)
        return fail(p, stage, code, STAGE_ABSENT, 0);
    if (map(p) != 0)
        return fail(p, stage, code, STAGE_MAP, errno);
    const uint64_t magic = atomic_load(&p->control->magic);
    if (magic != MAGIC)
        return fail(p, stage, code, magic == 0 ? STAGE_ABSENT : STAGE_FOREIGN, 0);
    if (p->control->crc != crc_of_control(p->control))
        return fail(p, stage, code, STAGE_DAMAGED, 0);
    p->slot = p->control->slot;
    memcpy(p->run_id, p->control->run_id, TEXT - 1);
    if (run_id[0] && strcmp(run_id, p->run_id) != 0)
        return fail(p, stage, code, STAGE_RUN, 0);
    if (control_bytes + 2 * (size_t)p->slot != p->size)
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

/* 1: the word has come to the value, 0: it is the one before, -1: it is neither, so damaged. */
static int judged(struct port *p, uint64_t word, unsigned value, int place)
{
    if (word == sealed(value, place))
        return 1;
    return word == sealed(value - 1, place) ? 0 : damaged(p, place, word);
}

/* Spin while *word is `old`. */
static void spin(struct port *p, _Atomic uint64_t *word, uint64_t old)
{
    const struct side *other = &p->control->side[1 - p->me];
    if (note_core(p) == atomic_load_explicit(&other->core, memory_order_relaxed))
        return;
    const double end = now() + SPIN;
    do
        for (int k = 0; k < PAUSES; k++) {
            if (atomic_load_explicit(word, memory_order_acquire) != old)
                return;
            pause_briefly();
        }
    while (now() < end);
}

/* The low half of a word, where its value is: processors of the port are little-endian. */
static void *futex_of(_Atomic uint64_t *word)
{
    return (void *)word;
}

/* Wait until *word goes from the value before to `value`, for at most one slice (s). */
static int wait_turn(struct port *p, _Atomic uint64_t *word, int place, unsigned value,
                     atomic_uint *sleeps, unsigned state, double slice)
{
    const uint64_t old = atomic_load_explicit(word, memory_order_acquire);
    const int come = judged(p, old, value, place);
    if (come != 0 || slice <= 0.0)
        return come;
    spin(p, word, old);
    if (atomic_load_explicit(word, memory_order_acquire) == old) {
        struct timespec limit = {.tv_sec = (time_t)slice};
        limit.tv_nsec = (long)(1e9 * (slice - (double)limit.tv_sec));
        p->slept += SLEPT;
        atomic_store(&p->control->side[p->me].state, sealed(p->slept | state, STATE + p->me));
        atomic_store(sleeps, 1u);
        if (atomic_load(word) == old)
            syscall(SYS_futex, futex_of(word), FUTEX_WAIT, (unsigned)old, &limit, NULL, 0);
        atomic_store(sleeps, 0u);
        if (atomic_load(word) != old)
            atomic_store(&p->control->side[p->me].state, sealed(WORKS, STATE + p->me));
    }
    return judged(p, atomic_load(word), value, place);
}

static void bump(_Atomic uint64_t *word, uint64_t value, atomic_uint *sleeps)
{
    atomic_store(word, value);
    if (atomic_load(sleeps))
        syscall(SYS_futex, futex_of(word), FUTEX_WAKE, INT_MAX, NULL, NULL, 0);
}

/* Write on from *done; 0 when all is written, 1 when the slice passed: call again; -1 when a
   control word is damaged. */
int talus_shm_write(struct port *p, const void *from, int64_t total, int64_t *done, double slice)
{
    struct channel *c = &p->control->channel[p->me];

    while (*done < total) {
        const int come = wait_turn(p, &c->taken, TAKEN + p->me, p->sent, &c->writer_sleeps,
                                   WAITS_TO_WRITE, slice);
        if (come <= 0)
            return come < 0 ? -1 : 1;
        const int64_t bytes = total - *done < p->slot ? total - *done : p->slot;
        p->sent++;
        c->chunk.number = p->sent;
        c->chunk.total = total;
        c->chunk.bytes = bytes;
        c->chunk.crc = crc_of_chunk(&c->chunk);
        copy_out(p->data[p->me], (const unsigned char *)from + *done, (size_t)bytes);
        *done += bytes;
        note_core(p);
        bump(&c->written, sealed(p->sent, WRITTEN + p->me), &c->reader_sleeps);
    }
    return 0;
}

/* Wait for the next chunk of the other side and check its byte counts. */
static int next_chunk(struct port *p, struct chunk *chunk, double slice)
{
    struct channel *c = &p->control->channel[1 - p->me];
    const int come = wait_turn(p, &c->written, WRITTEN + 1 - p->me, p->taken + 1,
                               &c->reader_sleeps, WAITS_TO_READ, slice);
    if (come <= 0)
        return come;
    *chunk = c->chunk;
    if (chunk->crc == crc_of_chunk(chunk) && chunk->number == p->taken + 1 && chunk->bytes > 0 &&
        chunk->bytes <= p->slot)
        return 1;
    return damaged(p, CHUNK + 1 - p->me, (uint64_t)chunk->bytes);
}

/* Bytes of the message that has begun to arrive; 0 when the slice passed without one; -1 when a
   control word is damaged. */
int64_t talus_shm_incoming(struct port *p, double slice)
{
    struct chunk chunk;
    const int come = next_chunk(p, &chunk, slice);
    return come == 1 ? chunk.total : come;
}

/* Read on from *done; 0 when all is here, 1 when the slice passed, -1 when a control word is
   damaged or the counts disagree. */
int talus_shm_read(struct port *p, void *to, int64_t total, int64_t *done, double slice)
{
    struct channel *c = &p->control->channel[1 - p->me];
    struct chunk chunk;

    while (*done < total) {
        const int come = next_chunk(p, &chunk, slice);
        if (come <= 0)
            return come < 0 ? -1 : 1;
        if (chunk.total != total || chunk.bytes > total - *done)
            return damaged(p, CHUNK + 1 - p->me, (uint64_t)chunk.total);
        memcpy((unsigned char *)to + *done, p->data[1 - p->me], (size_t)chunk.bytes);
        *done += chunk.bytes;
        p->taken++;
        note_core(p);
        bump(&c->taken, sealed(p->taken, TAKEN + 1 - p->me), &c->writer_sleeps);
    }
    return 0;
}

/* Process number, place and host of the other side; 0 while it has not joined, or when what it says
   of itself is damaged or belongs to another run. */
int talus_shm_partner(struct port *p, char *place, char *host, int room)
{
    struct side *s = &p->control->side[1 - p->me];
    const uint64_t joined = atomic_load(&s->joined);
    if (joined == 0)
        return 0;
    if (!whole(joined, JOINED + 1 - p->me))
        damaged(p, JOINED + 1 - p->me, joined);
    else if (s->crc != crc_of_side(s))
        damaged(p, ABOUT + 1 - p->me, s->crc);
    p->stranger = s->proof != proof_of_side(s, p->run_id);
    if (p->bad_place || p->stranger)
        return 0;
    snprintf(place, (size_t)room, "%.*s", TEXT - 1, s->about[0]);
    snprintf(host, (size_t)room, "%.*s", TEXT - 1, s->about[1]);
    p->met = 1;
    return (int)(unsigned)joined;
}

int64_t talus_shm_partner_beat(struct port *p)
{
    return (int64_t)atomic_load_explicit(&p->control->side[1 - p->me].beat, memory_order_relaxed);
}

/* 1 when the other side had joined and its lock has dropped: its process has ended. */
int talus_shm_partner_gone(struct port *p)
{
    short type = F_WRLCK;
    if (!p->met && atomic_load(&p->control->side[1 - p->me].joined) == 0)
        return 0;
    return lock_byte(p->fd, 1 - p->me, F_OFD_GETLK, &type) == 0 && type == F_UNLCK;
}

/* While the other side, too, waits for a message: how often it has slept; else -1. */
int talus_shm_partner_waits(struct port *p)
{
    const uint64_t state = atomic_load(&p->control->side[1 - p->me].state);
    if (!whole(state, STATE + 1 - p->me) || state % SLEPT != WAITS_TO_READ)
        return -1;
    return (int)((unsigned)state / SLEPT);
}

/* Whether a control word was found damaged, the words of the other side looked at again; which. */
int talus_shm_damage(struct port *p, char *text, int room)
{
    static const char *const names[] = {"", "chunks written", "chunks taken", "joined", "state",
                                        "byte counts of the slot", "place and host"};
    static const char *const owners[] = {"requests", "replies", "talus-couple", "the solver"};
    const int other = 1 - p->me;
    const struct side *s = &p->control->side[other];
    const uint64_t joined = atomic_load(&s->joined), state = atomic_load(&s->state);

    if (!p->bad_place && (joined ? !whole(joined, JOINED + other) : p->met))
        damaged(p, JOINED + other, joined);
    if (!p->bad_place && !whole(state, STATE + other))
        damaged(p, STATE + other, state);
    const int name = p->bad_place / 2, of_side = name == JOINED / 2 || name == STATE / 2 ||
                                                 name == ABOUT / 2;
    snprintf(text, (size_t)room, "'%s' of %s (seen: %016llX)", names[name],
             owners[p->bad_place % 2 + 2 * of_side], (unsigned long long)p->bad_word);
    return p->bad_place != 0;
}

/* Whether somebody has joined who does not know the run id. */
int talus_shm_stranger(struct port *p)
{
    return p->stranger;
}

void talus_shm_run_id(struct port *p, char *text, int room)
{
    snprintf(text, (size_t)room, "%s", p->run_id);
}

void talus_shm_beat(struct port *p)
{
    atomic_fetch_add_explicit(&p->control->side[p->me].beat, 1u, memory_order_relaxed);
}

void talus_shm_close(struct port *p)
{
    if (p->me == ASK)
        shm_unlink(p->name); /* unless the solver has done it */
    munmap(p->control, p->size);
    close(p->fd);
    free(p);
}
