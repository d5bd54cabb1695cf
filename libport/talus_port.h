/* The exchange port of Talus (manual/port.md): a solver of another make takes part in a coupled run.

   A partner opens the port that talus-couple names (--port=SPEC), then answers requests until STOP
   or ABORT:

       struct talus_port *port = talus_port_open(talus_port_spec(argc, argv));
       return talus_port_serve(port, "report,load,solve,reject,rehearsal", answer, &state);

   `answer` is called once a request. It reads fields of the request (talus_port_reals, ...), puts
   those of the reply (talus_port_put_reals, ...) or reports a fault (talus_port_fail). Fields of a
   request are views of the message: they hold until `answer` returns. What is asked for and is
   missing, of another kind or shape is reported by itself: the reply is then that fault, and the
   view is NULL. Fields that nobody has read are a fault too (P012), as the page demands; `final`,
   `trial` and `tag` may be passed over. Whoever
   wants a loop of his own calls talus_port_next and talus_port_reply.

   The library sends nothing but what it is given: units are SI, names are those of
   talus_port_names.h. A port belongs to one thread at a time; talus_port_beat may be called by any.
   Transport: shared memory; `attach:FILE` where that names it. */
#ifndef TALUS_PORT_H
#define TALUS_PORT_H

#include <stddef.h>
#include <stdint.h>

#include "talus_port_names.h"

#if defined(__GNUC__)
#define TALUS_PORT_API __attribute__((visibility("default")))
#else
#define TALUS_PORT_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

struct talus_port;

enum {
  TALUS_PORT_NOTHING = 0, /* the time has passed */
  TALUS_PORT_LOST = -1    /* the partner is gone or the port is damaged: talus_port_why */
};

/* --- an end of a port ------------------------------------------------------------------------ */

/* The SPEC of --port=SPEC among the arguments of a program; NULL when there is none. */
TALUS_PORT_API const char *talus_port_spec(int argc, char **argv);

/* Join a port; waits up to 30 s for talus-couple to make it (600 s for the file of attach:FILE).
   SIGINT and SIGTERM are talus-couple's from then on and ignored here. Always returns a port unless
   memory is lacking: where it could not be joined, talus_port_why says why and every call fails. */
TALUS_PORT_API struct talus_port *talus_port_open(const char *spec);

/* Make a port, as talus-couple does, for a solver that is started with --port=shm:/NAME. `slot` are
   the bytes that a chunk of a message may have, 0: 4 MiB. */
TALUS_PORT_API struct talus_port *talus_port_offer(const char *name, const char *run_id,
                                                   int64_t slot);

/* Why the last call failed; empty when it did not. */
TALUS_PORT_API const char *talus_port_why(const struct talus_port *port);

/* Sign of life; call it in long work. Costs nanoseconds. */
TALUS_PORT_API void talus_port_beat(struct talus_port *port);

/* Name of the coupled run. */
TALUS_PORT_API const char *talus_port_run_id(const struct talus_port *port);

TALUS_PORT_API void talus_port_close(struct talus_port *port);

/* --- a loop for a solver --------------------------------------------------------------------- */

/* Answer requests until the end; returns the exit code of the program (0, 3 after an early STOP, 4).
   `capabilities`: words of the page, comma between; verbs and roles without theirs are refused.
   `answer` is called for every request but those that the library refuses; ABORT too. The port is
   closed. What went wrong is written to standard error. */
typedef void talus_port_answer(struct talus_port *port, void *state);
TALUS_PORT_API int talus_port_serve(struct talus_port *port, const char *capabilities,
                                    talus_port_answer *answer, void *state);

/* Wait for the next request and return its verb, or TALUS_PORT_LOST. Requests that break the order
   of verbs (P021), are none (P017) or need another capability (P427) are answered here and not
   returned. */
TALUS_PORT_API int talus_port_next(struct talus_port *port, const char *capabilities);

/* Send the reply that was put together, or the fault; 0 or TALUS_PORT_LOST. */
TALUS_PORT_API int talus_port_reply(struct talus_port *port);

/* --- a request ------------------------------------------------------------------------------- */

TALUS_PORT_API int talus_port_verb(const struct talus_port *port);
TALUS_PORT_API int64_t talus_port_step(const struct talus_port *port);
TALUS_PORT_API double talus_port_t0(const struct talus_port *port); /* s */
TALUS_PORT_API double talus_port_t1(const struct talus_port *port); /* s */

/* A field as it came; kind 0 when it is not there. */
struct talus_port_field {
  int kind; /* enum talus_kind */
  int64_t components, count;
  const void *data;
};
TALUS_PORT_API struct talus_port_field talus_port_field(struct talus_port *port, const char *name);

/* 1 when the field is there; it then counts as read. */
TALUS_PORT_API int talus_port_has(struct talus_port *port, const char *name);

/* Views of required fields; count below 0: any. A text is ended by zero. NULL with a fault (P009,
   P010, P011) otherwise. */
TALUS_PORT_API const double *talus_port_reals(struct talus_port *port, const char *name,
                                              int64_t components, int64_t count);
TALUS_PORT_API const int64_t *talus_port_integers(struct talus_port *port, const char *name,
                                                  int64_t components, int64_t count);
TALUS_PORT_API const char *talus_port_text(struct talus_port *port, const char *name);

/* SET.NAME, the name of a field of a set; holds until the fourth call after this one. */
TALUS_PORT_API const char *talus_port_of(struct talus_port *port, const char *set,
                                         const char *name);

/* 1 when an optional field is there and is 1, as `brief` or `rehearsal`. */
TALUS_PORT_API int talus_port_flag(struct talus_port *port, const char *name);

/* A set of entities that SELECT named: kept from one request to the next. */
struct talus_port_set {
  char name[TALUS_PORT_NAME_LENGTH + 1], role[16], fields[128];
  int64_t count;
  const int64_t *id;
  int64_t *own; /* of the library */
};

/* Read SELECT and keep the set (in the place of one of its name); ids go from 1 to `entities`, else the
   reply is a fault (P425) and the result NULL. Sets move when another is selected. */
TALUS_PORT_API const struct talus_port_set *talus_port_select(struct talus_port *port,
                                                              int64_t entities);
TALUS_PORT_API const struct talus_port_set *talus_port_sets(const struct talus_port *port,
                                                            int *count);

/* --- a reply --------------------------------------------------------------------------------- */

/* Put a field into the reply. `data` is copied; NULL leaves room for the caller to fill, at the place
   that is returned, until the next field is put. */
TALUS_PORT_API double *talus_port_put_reals(struct talus_port *port, const char *name,
                                            int64_t components, int64_t count, const double *data);
TALUS_PORT_API int64_t *talus_port_put_integers(struct talus_port *port, const char *name,
                                                int64_t components, int64_t count,
                                                const int64_t *data);
TALUS_PORT_API void talus_port_put_text(struct talus_port *port, const char *name,
                                        const char *text);
TALUS_PORT_API void talus_port_put_real(struct talus_port *port, const char *name, double value);
TALUS_PORT_API void talus_port_put_integer(struct talus_port *port, const char *name,
                                           int64_t value);

/* The reply of HELLO: no gravity, time 0, one rank; put `gravity` and others after it, the last
   value of a name counts. */
TALUS_PORT_API void talus_port_put_hello(struct talus_port *port, const char *program,
                                         const char *version, const char *deck_hash);

/* The reply of DESCRIBE mesh for elements of one kind (enum talus_cell): positions (3, nodes) in m,
   node ids (corners, elements) in VTK order; lumped masses are 0, put `mass_u` after it. */
TALUS_PORT_API void talus_port_put_mesh(struct talus_port *port, int cell, int64_t nodes,
                                        const double *x, int64_t elements, int64_t corners,
                                        const int64_t *connectivity);

/* The reply of CHECKPOINT: path and hash of a file that was written. */
TALUS_PORT_API void talus_port_put_file(struct talus_port *port, const char *path);

/* Make the reply a fault; status: enum talus_status. The first fault counts. */
TALUS_PORT_API void talus_port_fail(struct talus_port *port, int status, const char *code,
                                    const char *message, const char *place, const char *hint);

/* 1 once a fault stands in this reply. */
TALUS_PORT_API int talus_port_failed(const struct talus_port *port);

/* --- whole messages, for both sides and other languages ----------------------------------------

   Words as the page has them; nothing is looked at but what moves them. */

/* Words of the message that arrives; 0 after `limit` seconds (below 0: never), or TALUS_PORT_LOST. */
TALUS_PORT_API int64_t talus_port_incoming(struct talus_port *port, double limit);

/* Take it; words as told by talus_port_incoming. 0 or TALUS_PORT_LOST. */
TALUS_PORT_API int talus_port_take(struct talus_port *port, uint64_t *word, int64_t words);

/* Send a message; 0 or TALUS_PORT_LOST. */
TALUS_PORT_API int talus_port_push(struct talus_port *port, const uint64_t *word, int64_t words);

/* Checksum of a message: that of its bytes with word 10 taken as 0. */
TALUS_PORT_API uint64_t talus_port_checksum(const uint64_t *word, int64_t words);

/* Process number of the other side, 0 while it has not joined; its heartbeat. */
TALUS_PORT_API int talus_port_partner(struct talus_port *port);
TALUS_PORT_API int64_t talus_port_partner_beat(struct talus_port *port);

#ifdef __cplusplus
}
#endif

#endif
