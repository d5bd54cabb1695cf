/* One end of a port in shared memory: join or make it, move whole messages, notice who has gone. */
#include <errno.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "port_parts.h"
#include "talus_port_shm.h"

/* common/port/talus_partner.c */
void talus_partner_place(char *text, int room);
void talus_partner_host(char *text, int room);

enum { SLEEPS_OF_LOSS = 20 };
static const double SLICE = 0.05, JOIN = 30.0, ATTACH = 600.0; /* s */
static const int64_t SLOT = 4 << 20, LONGEST = (int64_t)1 << 40; /* bytes */

double port_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void nap(void)
{
    const struct timespec t = {.tv_nsec = 10000000};
    nanosleep(&t, NULL);
}

int port_lost(struct talus_port *port, const char *format, ...)
{
    va_list rest;
    va_start(rest, format);
    if (!port->why[0])
        vsnprintf(port->why, sizeof port->why, format, rest);
    va_end(rest);
    return TALUS_PORT_LOST;
}

const char *talus_port_spec(int argc, char **argv)
{
    for (int k = 1; k < argc; k++)
        if (strncmp(argv[k], "--port=", 7) == 0)
            return argv[k] + 7;
    return NULL;
}

/* Port and run id, first and fourth line of the file of attach:FILE, once it is there; 0 or below. */
static int read_rendezvous(struct talus_port *port, const char *path, char *spec, size_t room)
{
    const double end = port_now() + ATTACH;
    FILE *file;
    while (!(file = fopen(path, "r"))) {
        if (port_now() > end)
            return port_lost(port, "P003: no talus-couple has written %s within %g s", path, ATTACH);
        nap();
    }
    if (!fgets(spec, (int)room, file))
        spec[0] = '\0';
    for (int line = 2; line <= 4; line++)
        if (!fgets(port->run_id, TEXT, file))
            port->run_id[0] = '\0';
    fclose(file);
    spec[strcspn(spec, "\n")] = '\0';
    port->run_id[strcspn(port->run_id, "\n")] = '\0';
    return 0;
}

static void connect_to(struct talus_port *port, const char *name)
{
    char place[TEXT], host[TEXT];
    int stage = 0, code = 0;
    const double end = port_now() + JOIN;

    talus_partner_place(place, TEXT);
    talus_partner_host(host, TEXT);
    while (!(port->shm = talus_shm_connect(name, port->run_id, place, host, &stage, &code))) {
        if (stage == STAGE_RUN)
            port_lost(port, "P027: the segment %s is not of the run %s", name, port->run_id);
        else if (stage != STAGE_ABSENT)
            port_lost(port, "P016: the segment %s cannot be joined: %s", name,
                      code ? strerror(code) : "it is damaged or of another version");
        else if (port_now() > end)
            port_lost(port, "P003: nobody has opened %s within %g s", name, JOIN);
        if (port->why[0])
            return;
        nap();
    }
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
    talus_shm_run_id(port->shm, port->run_id, TEXT);
    talus_port_partner(port);
}

struct talus_port *talus_port_open(const char *spec)
{
    struct talus_port *port = calloc(1, sizeof *port);
    char found[ROOM];

    if (!port)
        return NULL;
    if (spec && strncmp(spec, "attach:", 7) == 0) {
        if (read_rendezvous(port, spec + 7, found, sizeof found) < 0)
            return port;
        spec = found;
    }
    if (!spec)
        port_lost(port, "P004: no --port=SPEC was given: talus-couple starts this program");
    else if (strncmp(spec, "shm:/", 5) != 0)
        port_lost(port, "P004: the port '%.200s' is not in shared memory; &port transport = "
                        "'shared_memory' makes one", spec);
    else
        connect_to(port, spec + 4);
    return port;
}

struct talus_port *talus_port_offer(const char *name, const char *run_id, int64_t slot)
{
    struct talus_port *port = calloc(1, sizeof *port);
    char place[TEXT], host[TEXT];
    int stage = 0, code = 0;

    if (!port)
        return NULL;
    talus_partner_place(place, TEXT);
    talus_partner_host(host, TEXT);
    port->asks = 1;
    snprintf(port->run_id, sizeof port->run_id, "%s", run_id);
    port->shm = talus_shm_create(name, slot > 0 ? slot : SLOT, run_id, place, host, &stage, &code);
    if (!port->shm)
        port_lost(port, "P015: no segment %s: %s", name, strerror(code));
    return port;
}

const char *talus_port_why(const struct talus_port *port)
{
    return port ? port->why : "no memory";
}

const char *talus_port_run_id(const struct talus_port *port)
{
    return port->run_id;
}

void talus_port_beat(struct talus_port *port)
{
    if (port->shm)
        talus_shm_beat(port->shm);
}

int talus_port_partner(struct talus_port *port)
{
    char place[TEXT], host[TEXT];
    return port->shm ? talus_shm_partner(port->shm, place, host, TEXT) : 0;
}

int64_t talus_port_partner_beat(struct talus_port *port)
{
    return port->shm ? talus_shm_partner_beat(port->shm) : 0;
}

void talus_port_close(struct talus_port *port)
{
    if (!port)
        return;
    if (port->shm)
        talus_shm_close(port->shm);
    port_drop_sets(port);
    free(port->request.word);
    free(port->reply.word);
    free(port->read);
    free(port->text);
    free(port);
}

static int damaged(struct talus_port *port)
{
    char text[TEXT];
    if (!talus_shm_damage(port->shm, text, TEXT))
        snprintf(text, TEXT, "counts of a message");
    return port_lost(port, "P023: a control word of the port is damaged: %s", text);
}

/* Whether who has joined, if anybody, does not know whose run this is. */
static int stranger(struct talus_port *port)
{
    talus_port_partner(port);
    return talus_shm_stranger(port->shm) ? port_lost(port, "P027: who has joined this port does "
                                                           "not know the run id") : 0;
}

/* Between two slices: is the port whole, and is the other side there? */
static int look(struct talus_port *port, int reading)
{
    char text[TEXT];
    if (talus_shm_damage(port->shm, text, TEXT))
        return damaged(port);
    if (stranger(port) < 0)
        return TALUS_PORT_LOST;
    if (talus_shm_partner_gone(port->shm) && !(reading && talus_shm_incoming(port->shm, 0.0) > 0))
        return port_lost(port, "P001: the partner has ended");
    return 0;
}

/* How often the other side has slept since it waits as we do; a message is lost when that is often. */
static int lost_message(struct talus_port *port, int *first)
{
    const int slept = talus_shm_partner_waits(port->shm);
    if (slept < 0 || slept < *first || *first < 0 || talus_shm_incoming(port->shm, 0.0) != 0)
        *first = slept;
    if (slept >= 0 && slept - *first >= SLEEPS_OF_LOSS)
        return port_lost(port, "P024: a message was lost: both sides wait");
    return 0;
}

int64_t talus_port_incoming(struct talus_port *port, double limit)
{
    const double end = port_now() + limit;
    int first = -1;

    if (!port->shm)
        return port_lost(port, "the port is not open");
    for (;;) {
        const int64_t bytes = talus_shm_incoming(port->shm, SLICE);
        if (bytes < 0)
            return damaged(port);
        if (bytes % WORD || bytes > LONGEST)
            return port_lost(port, "P006: a message of %lld bytes", (long long)bytes);
        if (bytes > 0)
            return stranger(port) < 0 ? TALUS_PORT_LOST : bytes / WORD;
        if (look(port, 1) < 0 || lost_message(port, &first) < 0)
            return TALUS_PORT_LOST;
        if (limit >= 0.0 && port_now() > end)
            return TALUS_PORT_NOTHING;
    }
}

int talus_port_take(struct talus_port *port, uint64_t *word, int64_t words)
{
    int64_t done = 0;
    int state;

    if (!port->shm)
        return port_lost(port, "the port is not open");
    while ((state = talus_shm_read(port->shm, word, WORD * words, &done, SLICE)) > 0)
        if (look(port, 1) < 0)
            return TALUS_PORT_LOST;
    return state < 0 ? damaged(port) : 0;
}

int talus_port_push(struct talus_port *port, const uint64_t *word, int64_t words)
{
    int64_t done = 0;
    int state;

    if (!port->shm)
        return port_lost(port, "the port is not open");
    while ((state = talus_shm_write(port->shm, word, WORD * words, &done, SLICE)) > 0)
        if (look(port, 0) < 0)
            return TALUS_PORT_LOST;
    return state < 0 ? damaged(port) : 0;
}

uint64_t talus_port_checksum(const uint64_t *word, int64_t words)
{
    static const uint64_t zero = 0;
    const int64_t behind = TALUS_HEADER_CHECKSUM + 1;
    uint64_t crc = talus_crc64_bytes(word, WORD * TALUS_HEADER_CHECKSUM, 0);
    crc = talus_crc64_bytes(&zero, WORD, crc);
    return talus_crc64_bytes(word + behind, WORD * (words - behind), crc);
}
