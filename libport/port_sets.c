/* Sets that SELECT names, kept for the steps, and the mesh of DESCRIBE. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "port_parts.h"

/* The entry of a set: the one of that name, else a new one; NULL without memory. */
static struct talus_port_set *entry(struct talus_port *port, const char *name)
{
    for (int k = 0; k < port->sets; k++)
        if (strcmp(port->set[k].name, name) == 0)
            return port->set + k;
    struct talus_port_set *set = realloc(port->set, (size_t)(port->sets + 1) * sizeof *set);
    if (!set)
        return NULL;
    port->set = set;
    memset(set + port->sets, 0, sizeof *set);
    return set + port->sets++;
}

static const int64_t *known_ids(struct talus_port *port, int64_t entities, int64_t *count)
{
    char message[ROOM];
    const int64_t *id = talus_port_integers(port, TALUS_FIELD_ID, 1, -1);
    *count = talus_port_field(port, TALUS_FIELD_ID).count;
    for (int64_t k = 0; id && k < *count; k++)
        if (id[k] < 1 || id[k] > entities) {
            snprintf(message, sizeof message, "there is no entity %lld", (long long)id[k]);
            talus_port_fail(port, TALUS_STATUS_SYSTEM, "P425", message, TALUS_FIELD_ID,
                            "ids are those of DESCRIBE");
            return NULL;
        }
    return id;
}

const struct talus_port_set *talus_port_select(struct talus_port *port, int64_t entities)
{
    int64_t count;
    const char *name = talus_port_text(port, TALUS_FIELD_SET);
    const char *role = talus_port_text(port, TALUS_FIELD_ROLE);
    const char *fields = talus_port_has(port, TALUS_FIELD_FIELDS)
                             ? talus_port_text(port, TALUS_FIELD_FIELDS) : "";
    const int64_t *id = known_ids(port, entities, &count);
    int64_t *own = id ? malloc((size_t)(count + 1) * sizeof *own) : NULL;
    struct talus_port_set *set = own && name && role && fields ? entry(port, name) : NULL;

    if (!set) {
        free(own);
        talus_port_fail(port, TALUS_STATUS_SYSTEM, "P426", "no memory for a set", "", "");
        return NULL;
    }
    memcpy(own, id, (size_t)count * sizeof *own);
    free(set->own);
    snprintf(set->name, sizeof set->name, "%s", name);
    snprintf(set->role, sizeof set->role, "%s", role);
    snprintf(set->fields, sizeof set->fields, "%s", fields);
    set->id = set->own = own;
    set->count = count;
    return set;
}

const struct talus_port_set *talus_port_sets(const struct talus_port *port, int *count)
{
    *count = port->sets;
    return port->set;
}

void talus_port_put_mesh(struct talus_port *port, int cell, int64_t nodes, const double *x,
                         int64_t elements, int64_t corners, const int64_t *connectivity)
{
    int64_t *place = talus_port_put_integers(port, TALUS_FIELD_ID, 1, nodes, NULL);
    for (int64_t k = 0; place && k < nodes; k++)
        place[k] = k + 1;
    talus_port_put_reals(port, TALUS_FIELD_X, 3, nodes, x);
    talus_port_put_reals(port, TALUS_FIELD_MASS_U, 1, nodes, NULL);
    place = talus_port_put_integers(port, TALUS_FIELD_KIND, 1, elements, NULL);
    for (int64_t k = 0; place && k < elements; k++)
        place[k] = cell;
    place = talus_port_put_integers(port, TALUS_FIELD_START, 1, elements + 1, NULL);
    for (int64_t k = 0; place && k <= elements; k++)
        place[k] = 1 + k * corners;
    talus_port_put_integers(port, TALUS_FIELD_NODE, 1, elements * corners, connectivity);
    if (cell == TALUS_CELL_HEX8)
        talus_port_put_integers(port, TALUS_FIELD_CONNECTIVITY, corners, elements, connectivity);
}

void port_drop_sets(struct talus_port *port)
{
    for (int k = 0; k < port->sets; k++)
        free(port->set[k].own);
    free(port->set);
}
