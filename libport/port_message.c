/* A message as words: its fields, its checksum, and what is wrong with it. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "port_parts.h"

enum { HEAD = TALUS_PORT_HEADER_WORDS, DESCRIPTION = TALUS_PORT_FIELD_WORDS };
enum { AT_KIND = 6, AT_COMPONENTS, AT_COUNT, AT_WORDS };

double port_real_of(uint64_t word)
{
    double real;
    memcpy(&real, &word, sizeof real);
    return real;
}

uint64_t port_word_of(double real)
{
    uint64_t word;
    memcpy(&word, &real, sizeof word);
    return word;
}

static int reserve(struct talus_message *message, int64_t words)
{
    if (words <= message->room)
        return 0;
    const int64_t room = words + words / 2 + HEAD;
    uint64_t *word = realloc(message->word, (size_t)room * WORD);
    if (!word)
        return -1;
    message->word = word;
    message->room = room;
    return 0;
}

/* An empty reply to a request. */
void port_begin(struct talus_message *message, const struct talus_message *request)
{
    message->words = message->fields = 0;
    if (reserve(message, HEAD) != 0)
        return;
    memset(message->word, 0, HEAD * WORD);
    memcpy(message->word, request->word, (TALUS_HEADER_STATUS) * (size_t)WORD);
    memcpy(message->word, TALUS_PORT_MAGIC, WORD);
    message->word[TALUS_HEADER_PROTOCOL] = TALUS_PORT_PROTOCOL;
    message->words = HEAD;
}

void port_seal(struct talus_message *message)
{
    message->word[TALUS_HEADER_FIELDS] = (uint64_t)message->fields;
    message->word[TALUS_HEADER_WORDS] = (uint64_t)message->words;
    message->word[TALUS_HEADER_CHECKSUM] = talus_port_checksum(message->word, message->words);
}

static int same_name(const uint64_t *field, const char *name)
{
    const char *own = (const char *)field;
    const size_t n = strlen(name);
    if (n > TALUS_PORT_NAME_LENGTH || memcmp(own, name, n) != 0)
        return 0;
    for (size_t k = n; k < TALUS_PORT_NAME_LENGTH; k++)
        if (own[k] != ' ')
            return 0;
    return 1;
}

/* The description of the field behind this one. */
static uint64_t *after(uint64_t *field)
{
    return field + DESCRIPTION + field[AT_WORDS];
}

static uint64_t *find(const struct talus_message *message, const char *name, int64_t *number)
{
    uint64_t *field = message->word + HEAD;
    for (*number = 0; *number < message->fields; ++*number, field = after(field))
        if (same_name(field, name))
            return field;
    return NULL;
}

/* Whether the descriptions fill the message exactly. */
static int whole_fields(const struct talus_message *message)
{
    const uint64_t *field = message->word + HEAD, *end = message->word + message->words;
    for (int64_t k = 0; k < message->fields; k++) {
        if (end - field < DESCRIPTION)
            return 0;
        const uint64_t kind = field[AT_KIND], components = field[AT_COMPONENTS];
        const uint64_t count = field[AT_COUNT], data = field[AT_WORDS];
        const uint64_t room = (uint64_t)(end - field - DESCRIPTION);
        if (kind < TALUS_KIND_REAL || kind > TALUS_KIND_TEXT || data > room)
            return 0;
        if (kind == TALUS_KIND_TEXT ? count > 8 * data || data != (count + 7) / 8
                                    : components == 0 || count > room || data / components != count ||
                                          data % components != 0)
            return 0;
        field += DESCRIPTION + data;
    }
    return field == end;
}

/* Check a message that was taken; 0 or TALUS_PORT_LOST. */
int port_parse(struct talus_port *port, struct talus_message *message, int64_t words)
{
    const uint64_t *word = message->word;
    if (words < HEAD || memcmp(word, TALUS_PORT_MAGIC, WORD) != 0)
        return port_lost(port, "P005: what arrived at the port is no Talus message");
    if (word[TALUS_HEADER_PROTOCOL] != TALUS_PORT_PROTOCOL)
        return port_lost(port, "P005: the partner uses protocol %lld, this library %d",
                         (long long)word[TALUS_HEADER_PROTOCOL], TALUS_PORT_PROTOCOL);
    if (word[TALUS_HEADER_WORDS] != (uint64_t)words)
        return port_lost(port, "P006: a message of %lld words arrived with %lld",
                         (long long)word[TALUS_HEADER_WORDS], (long long)words);
    if (word[TALUS_HEADER_CHECKSUM] != talus_port_checksum(word, words))
        return port_lost(port, "P006: the checksum of a message is wrong");
    message->words = words;
    message->fields = (int64_t)word[TALUS_HEADER_FIELDS];
    if (!whole_fields(message))
        return port_lost(port, "P006: the description of a field is wrong");
    if (word[TALUS_HEADER_SEQUENCE] != port->sequence + 1)
        return port_lost(port, "P007: message %lld arrived, message %lld is due",
                         (long long)word[TALUS_HEADER_SEQUENCE], (long long)port->sequence + 1);
    port->sequence++;
    if (message->fields > port->read_room) {
        unsigned char *read = realloc(port->read, (size_t)message->fields);
        if (!read)
            return port_lost(port, "no memory for a message");
        port->read = read;
        port->read_room = message->fields;
    }
    if (message->fields > 0)
        memset(port->read, 0, (size_t)message->fields);
    return 0;
}

/* Fields that need nothing of a solver. */
static int may_be_passed_over(const uint64_t *field)
{
    return same_name(field, TALUS_FIELD_FINAL) || same_name(field, TALUS_FIELD_TRIAL) ||
           same_name(field, TALUS_FIELD_TAG);
}

/* P012 for a field of the request that nobody has read. */
void port_all_read(struct talus_port *port)
{
    char message[ROOM];
    uint64_t *field = port->request.word + HEAD;
    for (int64_t k = 0; k < port->request.fields; k++, field = after(field)) {
        if (port->read[k] || may_be_passed_over(field))
            continue;
        int n = TALUS_PORT_NAME_LENGTH;
        while (n > 0 && ((const char *)field)[n - 1] == ' ')
            n--;
        snprintf(message, sizeof message, "the field '%.*s' is not known here", n,
                 (const char *)field);
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P012", message, "",
                        "use programs with the same version of the port");
        return;
    }
}

/* --- fields of the request ------------------------------------------------------------------- */

struct talus_port_field talus_port_field(struct talus_port *port, const char *name)
{
    struct talus_port_field view = {0};
    int64_t number;
    const uint64_t *field = find(&port->request, name, &number);
    if (!field)
        return view;
    port->read[number] = 1;
    view.kind = (int)field[AT_KIND];
    view.components = (int64_t)field[AT_COMPONENTS];
    view.count = (int64_t)field[AT_COUNT];
    view.data = field + DESCRIPTION;
    return view;
}

int talus_port_has(struct talus_port *port, const char *name)
{
    return talus_port_field(port, name).kind != 0;
}

int talus_port_flag(struct talus_port *port, const char *name)
{
    const struct talus_port_field view = talus_port_field(port, name);
    return view.kind == TALUS_KIND_INTEGER && view.count > 0 && *(const int64_t *)view.data == 1;
}

static const void *required(struct talus_port *port, const char *name, int kind,
                            int64_t components, int64_t count)
{
    static const char *const kinds[] = {"nothing", "reals", "integers", "text"};
    char message[ROOM];
    const struct talus_port_field view = talus_port_field(port, name);

    if (view.kind == 0) {
        snprintf(message, sizeof message, "the field '%.100s' is missing", name);
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P009", message, "", "the page has all fields");
    } else if (view.kind != kind) {
        snprintf(message, sizeof message, "the field '%.100s' holds %s, %s were due", name,
                 kinds[view.kind], kinds[kind]);
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P011", message, "", "the page has all kinds");
    } else if (kind != TALUS_KIND_TEXT &&
               (view.components != components || (count >= 0 && view.count != count))) {
        snprintf(message, sizeof message, "the field '%.100s' is %lld x %lld, %lld x %lld is due",
                 name, (long long)view.components, (long long)view.count, (long long)components,
                 (long long)(count < 0 ? view.count : count));
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P010", message, "", "the page has all shapes");
    } else {
        return view.data;
    }
    return NULL;
}

const double *talus_port_reals(struct talus_port *port, const char *name, int64_t components,
                               int64_t count)
{
    return required(port, name, TALUS_KIND_REAL, components, count);
}

const int64_t *talus_port_integers(struct talus_port *port, const char *name, int64_t components,
                                   int64_t count)
{
    return required(port, name, TALUS_KIND_INTEGER, components, count);
}

const char *talus_port_text(struct talus_port *port, const char *name)
{
    const char *text = required(port, name, TALUS_KIND_TEXT, 1, -1);
    if (!text)
        return NULL;
    /* a copy that is ended by zero; all texts of a request fit behind each other */
    const size_t n = (size_t)talus_port_field(port, name).count;
    const size_t at = (size_t)(text - (const char *)port->request.word);
    if (port->text_room < (size_t)port->request.words * WORD + WORD) {
        port->text_room = (size_t)port->request.words * WORD + WORD;
        free(port->text);
        port->text = malloc(port->text_room);
    }
    if (!port->text)
        return NULL;
    memcpy(port->text + at, text, n);
    port->text[at + n] = '\0';
    return port->text + at;
}

const char *talus_port_of(struct talus_port *port, const char *set, const char *name)
{
    char *text = port->name[port->next_name];
    port->next_name = (port->next_name + 1) % NAMES;
    snprintf(text, sizeof port->name[0], "%.47s.%.40s", set, name);
    return text;
}

/* --- fields of the reply --------------------------------------------------------------------- */

/* Take out a field that is put again. */
static void drop(struct talus_message *message, const char *name)
{
    int64_t number;
    uint64_t *field = find(message, name, &number);
    if (!field)
        return;
    uint64_t *next = after(field), *end = message->word + message->words;
    message->words -= next - field;
    message->fields--;
    memmove(field, next, (size_t)(end - next) * WORD);
}

static void *put(struct talus_port *port, const char *name, int kind, int64_t components,
                 int64_t count)
{
    struct talus_message *message = &port->reply;
    const int64_t data = kind == TALUS_KIND_TEXT ? (count + 7) / 8 : components * count;
    const size_t length = strlen(name);

    if (message->words >= HEAD)
        drop(message, name);
    if (length > TALUS_PORT_NAME_LENGTH || components < 1 || count < 0 ||
        reserve(message, message->words + DESCRIPTION + data) != 0) {
        talus_port_fail(port, TALUS_STATUS_BUG, "P426", "a field of the reply cannot be put", name,
                        "its name is at most 48 characters, its counts are not negative");
        return NULL;
    }
    uint64_t *field = message->word + message->words;
    memset(field, ' ', TALUS_PORT_NAME_LENGTH);
    memcpy(field, name, length);
    field[AT_KIND] = (uint64_t)kind;
    field[AT_COMPONENTS] = (uint64_t)components;
    field[AT_COUNT] = (uint64_t)count;
    field[AT_WORDS] = (uint64_t)data;
    memset(field + DESCRIPTION, 0, (size_t)data * WORD);
    message->words += DESCRIPTION + data;
    message->fields++;
    return field + DESCRIPTION;
}

double *talus_port_put_reals(struct talus_port *port, const char *name, int64_t components,
                             int64_t count, const double *data)
{
    double *place = put(port, name, TALUS_KIND_REAL, components, count);
    if (place && data)
        memcpy(place, data, (size_t)(components * count) * sizeof *data);
    return place;
}

int64_t *talus_port_put_integers(struct talus_port *port, const char *name, int64_t components,
                                 int64_t count, const int64_t *data)
{
    int64_t *place = put(port, name, TALUS_KIND_INTEGER, components, count);
    if (place && data)
        memcpy(place, data, (size_t)(components * count) * sizeof *data);
    return place;
}

void talus_port_put_text(struct talus_port *port, const char *name, const char *text)
{
    char *place = put(port, name, TALUS_KIND_TEXT, 1, (int64_t)strlen(text));
    if (place)
        memcpy(place, text, strlen(text));
}

void talus_port_put_real(struct talus_port *port, const char *name, double value)
{
    talus_port_put_reals(port, name, 1, 1, &value);
}

void talus_port_put_integer(struct talus_port *port, const char *name, int64_t value)
{
    talus_port_put_integers(port, name, 1, 1, &value);
}
