/* What the files of this library share; a partner sees talus_port.h alone. */
#ifndef PORT_PARTS_H
#define PORT_PARTS_H

#include "talus_port.h"

enum { WORD = 8, NAMES = 4, ROOM = 512 };

struct talus_message {
    uint64_t *word;
    int64_t words, room;
    int64_t fields;
};

struct talus_fault {
    int status;
    char code[8], message[ROOM], place[ROOM], hint[ROOM];
};

struct talus_port {
    struct port *shm; /* NULL: not open */
    int asks;
    uint64_t sequence;
    struct talus_message request, reply;
    unsigned char *read;  /* of each field of the request whether it was read */
    int64_t read_room;
    char *text;           /* of the request, ended by zero */
    size_t text_room;
    struct talus_fault fault;
    int greeted, begun, left, early;
    double waited;        /* s for the request */
    struct talus_port_set *set;
    int sets;
    char name[NAMES][2 * TALUS_PORT_NAME_LENGTH];
    int next_name;
    char why[ROOM], run_id[128];
};

/* port_end.c */
double port_now(void);
int port_lost(struct talus_port *port, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* port_message.c */
double port_real_of(uint64_t word);
uint64_t port_word_of(double real);
void port_begin(struct talus_message *message, const struct talus_message *request);
void port_seal(struct talus_message *message);
int port_parse(struct talus_port *port, struct talus_message *message, int64_t words);
void port_all_read(struct talus_port *port);

/* port_sets.c */
void port_drop_sets(struct talus_port *port);

#endif
