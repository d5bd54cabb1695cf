/* Requests and replies: the order of verbs, capabilities, faults, the end. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "port_parts.h"

/* common/base/talus_hash.c */
int talus_c_hash_file(const char *path, int64_t *hash);

/* What a verb needs of the capabilities; NULL: nothing. */
static const char *needed(int verb)
{
    switch (verb) {
    case TALUS_VERB_ADVANCE: return TALUS_CAN_ADVANCE;
    case TALUS_VERB_SOLVE: return TALUS_CAN_SOLVE;
    case TALUS_VERB_FORCE: return TALUS_CAN_FORCE;
    case TALUS_VERB_KICK_DRIFT: return TALUS_CAN_KICK_DRIFT;
    case TALUS_VERB_REJECT: return TALUS_CAN_REJECT;
    case TALUS_VERB_CHECKPOINT: return TALUS_CAN_CHECKPOINT;
    case TALUS_VERB_WAKE:
    case TALUS_VERB_SLEEP:
    case TALUS_VERB_RELAX: return TALUS_CAN_POPULATION;
    default: return NULL;
    }
}

/* Whether a word stands in a list with commas. */
static int among(const char *list, const char *word)
{
    const size_t n = strlen(word);
    for (const char *at = list; at && *at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL)
        if (strncmp(at, word, n) == 0 && (at[n] == ',' || at[n] == '\0'))
            return 1;
    return 0;
}

int talus_port_verb(const struct talus_port *port)
{
    return (int)port->request.word[TALUS_HEADER_VERB];
}

int64_t talus_port_step(const struct talus_port *port)
{
    return (int64_t)port->request.word[TALUS_HEADER_STEP];
}

double talus_port_t0(const struct talus_port *port)
{
    return port_real_of(port->request.word[TALUS_HEADER_T0]);
}

double talus_port_t1(const struct talus_port *port)
{
    return port_real_of(port->request.word[TALUS_HEADER_T1]);
}

void talus_port_fail(struct talus_port *port, int status, const char *code, const char *message,
                     const char *place, const char *hint)
{
    struct talus_fault *fault = &port->fault;
    if (fault->status != 0)
        return;
    fault->status = status;
    snprintf(fault->code, sizeof fault->code, "%s", code);
    snprintf(fault->message, sizeof fault->message, "%s", message);
    snprintf(fault->place, sizeof fault->place, "%s", place ? place : "");
    snprintf(fault->hint, sizeof fault->hint, "%s", hint ? hint : "");
}

int talus_port_failed(const struct talus_port *port)
{
    return port->fault.status != 0;
}

/* A protocol that is not ours ends the run: nothing else could be understood. */
static void check_hello(struct talus_port *port)
{
    const int64_t *protocol = talus_port_integers(port, TALUS_FIELD_PROTOCOL, 1, 1);
    talus_port_text(port, TALUS_FIELD_RUN_ID);
    talus_port_text(port, TALUS_FIELD_RESTART);
    if (protocol && *protocol != TALUS_PORT_PROTOCOL)
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P005", "the partner uses another protocol",
                        "HELLO", "use programs with the same version of the port");
}

static void check_order(struct talus_port *port)
{
    const int verb = talus_port_verb(port);
    const int leaves = verb == TALUS_VERB_STOP || verb == TALUS_VERB_ABORT;
    if (verb < TALUS_VERB_HELLO || verb > TALUS_VERB_RELAX)
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P017", "the request has a verb that is not known",
                        "", "use programs with the same version of the port");
    else if (!port->greeted && !leaves && verb != TALUS_VERB_HELLO)
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P021", "a request before HELLO", "",
                        "HELLO is the first request");
    else if (!port->begun && verb >= TALUS_VERB_ADVANCE && verb <= TALUS_VERB_REJECT)
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P021", "a step before READY", "",
                        "READY must precede all steps");
}

static void check_capability(struct talus_port *port, const char *capabilities)
{
    const char *word = needed(talus_port_verb(port));
    if (talus_port_verb(port) == TALUS_VERB_SELECT)
        word = talus_port_text(port, TALUS_FIELD_ROLE);
    if (talus_port_failed(port) || !word || !capabilities || among(capabilities, word))
        return;
    talus_port_fail(port, TALUS_STATUS_SYSTEM, "P427",
                    "this solver has not the capability that the request needs", word, capabilities);
}

static int take_request(struct talus_port *port)
{
    const double began = port_now();
    const int64_t words = talus_port_incoming(port, -1.0);
    if (words < 0)
        return TALUS_PORT_LOST;
    port->waited = port_now() - began;
    if (words > port->request.room) {
        uint64_t *word = realloc(port->request.word, (size_t)words * WORD);
        if (!word)
            return port_lost(port, "no memory for a message of %lld words", (long long)words);
        port->request.word = word;
        port->request.room = words;
    }
    if (talus_port_take(port, port->request.word, words) < 0)
        return TALUS_PORT_LOST;
    return port_parse(port, &port->request, words);
}

int talus_port_next(struct talus_port *port, const char *capabilities)
{
    for (;;) {
        if (take_request(port) < 0)
            return TALUS_PORT_LOST;
        memset(&port->fault, 0, sizeof port->fault);
        port_begin(&port->reply, &port->request);
        check_order(port);
        if (!talus_port_failed(port) && talus_port_verb(port) == TALUS_VERB_HELLO)
            check_hello(port);
        if (!talus_port_failed(port))
            check_capability(port, capabilities);
        if (!talus_port_failed(port))
            break;
        if (talus_port_reply(port) < 0)
            return TALUS_PORT_LOST;
    }
    if (talus_port_verb(port) == TALUS_VERB_HELLO && capabilities)
        talus_port_put_text(port, TALUS_FIELD_CAPABILITIES, capabilities);
    if (talus_port_verb(port) == TALUS_VERB_STOP || talus_port_verb(port) == TALUS_VERB_ABORT) {
        port->left = 1;
        port->early = talus_port_flag(port, TALUS_FIELD_EARLY);
    }
    return talus_port_verb(port);
}

static void put_fault(struct talus_port *port)
{
    port_begin(&port->reply, &port->request);
    port->reply.word[TALUS_HEADER_STATUS] = (uint64_t)port->fault.status;
    talus_port_put_text(port, TALUS_FIELD_ERROR_CODE, port->fault.code);
    talus_port_put_text(port, TALUS_FIELD_ERROR_MESSAGE, port->fault.message);
    talus_port_put_text(port, TALUS_FIELD_ERROR_PLACE, port->fault.place);
    talus_port_put_text(port, TALUS_FIELD_ERROR_HINT, port->fault.hint);
}

int talus_port_reply(struct talus_port *port)
{
    if (!talus_port_failed(port))
        port_all_read(port);
    if (talus_port_failed(port))
        put_fault(port);
    else if (talus_port_verb(port) == TALUS_VERB_HELLO)
        port->greeted = 1;
    else if (talus_port_verb(port) == TALUS_VERB_READY)
        port->begun = 1;
    port->reply.word[TALUS_HEADER_WAITED] = port_word_of(port->waited);
    port_seal(&port->reply);
    talus_port_beat(port);
    return talus_port_push(port, port->reply.word, port->reply.words);
}

int talus_port_serve(struct talus_port *port, const char *capabilities, talus_port_answer *answer,
                     void *state)
{
    int code = TALUS_STATUS_SYSTEM, verb = TALUS_PORT_LOST;

    while (port && !port->left && (verb = talus_port_next(port, capabilities)) > 0) {
        answer(port, state);
        if (talus_port_reply(port) < 0 && verb != TALUS_VERB_ABORT)
            verb = TALUS_PORT_LOST;
        if (verb == TALUS_PORT_LOST)
            break;
    }
    if (verb == TALUS_PORT_LOST)
        fprintf(stderr, "error %s\n", talus_port_why(port));
    else if (verb == TALUS_VERB_STOP)
        code = port->early ? TALUS_STATUS_STOPPED : TALUS_STATUS_GOOD;
    talus_port_close(port);
    return code;
}

void talus_port_put_hello(struct talus_port *port, const char *program, const char *version,
                          const char *deck_hash)
{
    talus_port_put_text(port, TALUS_FIELD_PROGRAM, program);
    talus_port_put_text(port, TALUS_FIELD_VERSION, version);
    talus_port_put_text(port, TALUS_FIELD_DECK_HASH, deck_hash);
    talus_port_put_reals(port, TALUS_FIELD_GRAVITY, 1, 3, NULL);
    talus_port_put_real(port, TALUS_FIELD_TIME, 0.0);
    talus_port_put_real(port, TALUS_FIELD_T_END, 0.0);
    talus_port_put_real(port, TALUS_FIELD_STEP_LIMIT, 0.0);
    talus_port_put_integer(port, TALUS_FIELD_RANKS, 1);
}

void talus_port_put_file(struct talus_port *port, const char *path)
{
    char hex[17];
    int64_t hash = 0;
    if (talus_c_hash_file(path, &hash) != 0) {
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P428", "a file of the reply cannot be read", path,
                        "look at the disk");
        return;
    }
    snprintf(hex, sizeof hex, "%016llX", (unsigned long long)hash);
    talus_port_put_text(port, TALUS_FIELD_PATH, path);
    talus_port_put_text(port, TALUS_FIELD_HASH, hex);
}
