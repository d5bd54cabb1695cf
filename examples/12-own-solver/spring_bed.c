/* A solid of another make at the port of Talus: a rigid plate on a bed of springs, in C11.

   cc spring_bed.c -ltalus_port -o spring_bed; talus-couple starts `spring_bed FILE --port=SPEC`, where
   FILE holds the stiffness in N/m. The mesh is one hex8, its upper face the facet group `top`. */
#include <stdio.h>
#include <string.h>
#include <talus_port.h>
enum { NODES = 8, BASE = 4 };
static double stiffness, accepted, trial; /* N/m, m, m */

static void describe(struct talus_port *port)
{
    static const double x[3 * NODES] = {-.02, -.02, -.01, .02, -.02, -.01, .02, .02, -.01, -.02, .02, -.01,
                                        -.02, -.02, 0,    .02, -.02, 0,    .02, .02, 0,    -.02, .02, 0};
    static const int64_t node[NODES] = {1, 2, 3, 4, 5, 6, 7, 8};
    const char *what = talus_port_text(port, TALUS_FIELD_WHAT);
    const char *group = talus_port_has(port, TALUS_FIELD_GROUP) ? talus_port_text(port, TALUS_FIELD_GROUP) : "";
    if (what && strcmp(what, TALUS_WHAT_MESH) == 0)
        talus_port_put_mesh(port, TALUS_CELL_HEX8, NODES, x, 1, NODES, node);
    else if (what && group && strcmp(what, TALUS_WHAT_FACETS) == 0 && strcmp(group, "top") == 0) {
        talus_port_put_integer(port, TALUS_FIELD_KIND, TALUS_CELL_QUAD4);
        talus_port_put_integers(port, TALUS_FIELD_CONNECTIVITY, 4, 1, node + BASE);
    } else talus_port_fail(port, TALUS_STATUS_SYSTEM, "P301", "the bed has a mesh and facets 'top'", "DESCRIBE", "");
}

static void take_set(struct talus_port *port)
{
    const struct talus_port_set *set = talus_port_select(port, NODES);
    if (!set) return;
    talus_port_put_reals(port, TALUS_FIELD_MASS, 1, set->count, NULL);
    talus_port_put_reals(port, TALUS_FIELD_SPEED, 3, set->count, NULL);
    double *k = talus_port_put_reals(port, TALUS_FIELD_STIFFNESS, 1, set->count, NULL);
    for (int64_t j = 0; j < set->count; j++) k[j] = stiffness / 4;
    int64_t *held = talus_port_put_integers(port, TALUS_FIELD_HELD, 3, set->count, NULL);
    for (int64_t j = 0; j < 3 * set->count; j++) held[j] = j % 3 < 2 || set->id[j / 3] <= BASE;
}

/* The motion (0, 0, z) of the plate's nodes in a set. */
static void put_motion(struct talus_port *port, const struct talus_port_set *set, const char *name, double z)
{
    double *value = talus_port_put_reals(port, talus_port_of(port, set->name, name), 3, set->count, NULL);
    for (int64_t j = 0; j < set->count; j++) value[3 * j + 2] = set->id[j] > BASE ? z : 0;
}

static void step(struct talus_port *port, int solves)
{
    int sets;
    double force = 0, rate = 0;
    const struct talus_port_set *set = talus_port_sets(port, &sets);
    for (int k = 0; k < sets && solves; k++) {
        const char *name = talus_port_of(port, set[k].name, TALUS_FIELD_FORCE);
        const double *f = talus_port_has(port, name) ? talus_port_reals(port, name, 3, set[k].count) : NULL;
        for (int64_t j = 0; f && j < set[k].count; j++) force += set[k].id[j] > BASE ? f[3 * j + 2] : 0;
    }
    if (solves && !talus_port_failed(port)) trial = force / stiffness;
    if (solves) rate = (trial - accepted) / (talus_port_t1(port) - talus_port_t0(port));
    else talus_port_has(port, TALUS_FIELD_REHEARSAL);
    talus_port_put_integer(port, TALUS_FIELD_ITERATIONS, solves);
    double *scalars = talus_port_put_reals(port, TALUS_FIELD_SCALARS, 1, TALUS_PORT_SCALARS, NULL);
    scalars[TALUS_SCALAR_ELASTIC] = scalars[TALUS_SCALAR_BOUNDARY] = stiffness * trial * trial / 2;
    for (int k = 0; k < sets; k++) {
        put_motion(port, set + k, TALUS_FIELD_U, trial);
        put_motion(port, set + k, TALUS_FIELD_V, rate);
        put_motion(port, set + k, TALUS_FIELD_A, 0);
    }
}

static void answer(struct talus_port *port, void *state)
{
    (void)state;
    switch (talus_port_verb(port)) {
    case TALUS_VERB_HELLO: talus_port_put_hello(port, "spring_bed", "1.0", "none"); break;
    case TALUS_VERB_DESCRIBE: describe(port); break;
    case TALUS_VERB_SELECT: take_set(port); break;
    case TALUS_VERB_READY: step(port, 0); break;
    case TALUS_VERB_SOLVE: step(port, 1); break;
    case TALUS_VERB_ACCEPT: accepted = trial; break;
    case TALUS_VERB_REJECT: trial = accepted; break;
    case TALUS_VERB_STOP: case TALUS_VERB_ABORT: break;
    default: talus_port_fail(port, TALUS_STATUS_SYSTEM, "P301", "the bed does not answer this", "", "see HELLO");
    }
}

int main(int argc, char **argv)
{
    FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
    if (!file || fscanf(file, "%lf", &stiffness) != 1 || fclose(file) != 0)
        return fprintf(stderr, "usage: spring_bed FILE --port=SPEC\n"), TALUS_STATUS_INPUT;
    return talus_port_serve(talus_port_open(talus_port_spec(argc, argv)), "report,load,solve,reject,rehearsal",
                            answer, NULL);
}
