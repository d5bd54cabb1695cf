/* Names and numbers of the exchange port (manual/port.md), C11.
   made by tools/port.py from common/port/port.toml: change that file, then `make port`. */
#ifndef TALUS_PORT_NAMES_H
#define TALUS_PORT_NAMES_H

#define TALUS_PORT_MAGIC "TALUSMSG"
#define TALUS_PORT_PROTOCOL 2
#define TALUS_PORT_HEADER_WORDS 16
#define TALUS_PORT_FIELD_WORDS 10
#define TALUS_PORT_NAME_LENGTH 48
#define TALUS_PORT_SCALARS 19

/* kinds of fields */
enum talus_kind {
  TALUS_KIND_REAL = 1, /* IEEE 64-bit */
  TALUS_KIND_INTEGER = 2, /* 64 bits */
  TALUS_KIND_TEXT = 3, /* bytes, ASCII */
};

/* status of a reply */
enum talus_status {
  TALUS_STATUS_GOOD = 0, /* the request was carried out */
  TALUS_STATUS_INPUT = 1, /* an input fault: nothing was run */
  TALUS_STATUS_NUMERICAL = 2, /* a numerical failure: the run cannot go on */
  TALUS_STATUS_STOPPED = 3, /* stopped early on request (an exit code only) */
  TALUS_STATUS_SYSTEM = 4, /* file, memory, partner, or a request that cannot be carried out */
  TALUS_STATUS_BUG = 5, /* a fault of the program itself */
};

/* verbs */
enum talus_verb {
  TALUS_VERB_HELLO = 1, /* who are you; must be the first */
  TALUS_VERB_DESCRIBE = 2, /* grains, contacts, mesh, facets, groups */
  TALUS_VERB_SELECT = 3, /* name a set of entities and its role */
  TALUS_VERB_SET = 4, /* weights, springs, dead loads, moduli */
  TALUS_VERB_READY = 5, /* state and forces at t with everything set, like the reply of a step of no duration */
  TALUS_VERB_ADVANCE = 6, /* own sub-steps to t₁; prescribed motion is linear from t₀ (rotations by slerp), loads are held */
  TALUS_VERB_SOLVE = 7, /* one static or implicit step from the accepted state to t₁ */
  TALUS_VERB_FORCE = 8, /* forces with prescribed entities where the request puts them; no time passes */
  TALUS_VERB_KICK_DRIFT = 9, /* v += kick (F + X)/m of free entities, then x += drift v; rotations alike */
  TALUS_VERB_ACCEPT = 10, /* keep the step; due output is written */
  TALUS_VERB_REJECT = 11, /* back to the last accepted state */
  TALUS_VERB_CHECKPOINT = 12, /* write a checkpoint of the accepted state */
  TALUS_VERB_WRITE = 13, /* write fields now */
  TALUS_VERB_STOP = 14, /* normal end */
  TALUS_VERB_ABORT = 15, /* leave at once */
  TALUS_VERB_WAKE = 16, /* grains enter; no time passes, all sets but surfaces are forgotten */
  TALUS_VERB_SLEEP = 17, /* grains leave; no time passes, all sets but surfaces are forgotten */
  TALUS_VERB_RELAX = 18, /* some free grains come to rest with adaptive damping under their contacts and weight, without forces of the partner, all else is held; no time passes, all sets but surfaces are forgotten */
};

/* kinds of elements and facets */
enum talus_cell {
  TALUS_CELL_HEX8 = 1,
  TALUS_CELL_HEX20 = 2,
  TALUS_CELL_HEX27 = 3,
  TALUS_CELL_TET4 = 4,
  TALUS_CELL_TET10 = 5,
  TALUS_CELL_WEDGE6 = 6,
  TALUS_CELL_QUAD4 = 7,
  TALUS_CELL_QUAD8 = 8,
  TALUS_CELL_QUAD9 = 9,
  TALUS_CELL_TRI3 = 10,
  TALUS_CELL_TRI6 = 11,
};

/* health flags, summed in the scalar flags */
enum talus_flag {
  TALUS_FLAG_LATE_REBUILD = 1, /* a list was rebuilt later than its skin allows */
  TALUS_FLAG_LARGE_OVERLAP = 2, /* an overlap is above the deck's limit */
};

/* words of the header, from 0 */
enum talus_header {
  TALUS_HEADER_MAGIC = 0, /* the bytes `TALUSMSG` */
  TALUS_HEADER_PROTOCOL = 1, /* protocol version, 2 */
  TALUS_HEADER_SEQUENCE = 2, /* 1 for the first request, one more for each; the reply repeats it */
  TALUS_HEADER_VERB = 3, /* number of the verb */
  TALUS_HEADER_STEP = 4, /* number of the coupled step */
  TALUS_HEADER_T0 = 5, /* t₀, start of the interval, s (real) */
  TALUS_HEADER_T1 = 6, /* t₁, end of the interval, s (real) */
  TALUS_HEADER_STATUS = 7, /* 0, or the exit code of the fault that the reply reports */
  TALUS_HEADER_FIELDS = 8, /* number of fields */
  TALUS_HEADER_WORDS = 9, /* words of the whole message */
  TALUS_HEADER_CHECKSUM = 10, /* see below */
  TALUS_HEADER_WAITED = 11, /* of a reply: for how many seconds its sender had waited for the request (real), 0 if not reported; else 0 */
};

/* places in the field scalars, from 0 */
enum talus_scalar {
  TALUS_SCALAR_KINETIC = 0, /* kinetic energy, now [J] */
  TALUS_SCALAR_ELASTIC = 1, /* energy stored in contacts or elements, now [J] */
  TALUS_SCALAR_FRICTION = 2, /* spent in sliding, rolling, breaking bonds and grains [J] */
  TALUS_SCALAR_CONTACT_DAMPING = 3, /* spent in dashpots of contacts [J] */
  TALUS_SCALAR_BACKGROUND_DAMPING = 4, /* spent in damping of the whole body, and numerically [J] */
  TALUS_SCALAR_CURVATURE = 5, /* work of the changing stiffness of contacts [J] */
  TALUS_SCALAR_TANGENTIAL_RELAXATION = 6, /* spent where tangential springs are shortened [J] */
  TALUS_SCALAR_PLASTIC = 7, /* plastic work [J] */
  TALUS_SCALAR_BOUNDARY = 8, /* work done by all prescriptions and loads [J] */
  TALUS_SCALAR_GRAVITY = 9, /* work done by gravity [J] */
  TALUS_SCALAR_MOMENTUM = 10, /* x, y, z, now [kg m/s] */
  TALUS_SCALAR_ANGULAR_MOMENTUM = 13, /* x, y, z about the origin, now [N m s] */
  TALUS_SCALAR_STEP_LIMIT = 16, /* largest stable step, now; 0: none [s] */
  TALUS_SCALAR_MAX_OVERLAP = 17, /* largest overlap over the radius of its grain [1] */
  TALUS_SCALAR_FLAGS = 18, /* sum of the health flags since the last reply [1] */
};

/* roles of sets */
#define TALUS_ROLE_REPORT "report"
#define TALUS_ROLE_PRESCRIBE "prescribe"
#define TALUS_ROLE_LOAD "load"
#define TALUS_ROLE_SURFACE "surface"
#define TALUS_ROLE_BORDER "border"
#define TALUS_ROLE_PORE "pore"

/* words of HELLO's capabilities */
#define TALUS_CAN_REPORT "report"
#define TALUS_CAN_PRESCRIBE "prescribe"
#define TALUS_CAN_LOAD "load"
#define TALUS_CAN_SURFACE "surface"
#define TALUS_CAN_BORDER "border"
#define TALUS_CAN_ADVANCE "advance"
#define TALUS_CAN_SOLVE "solve"
#define TALUS_CAN_FORCE "force"
#define TALUS_CAN_KICK_DRIFT "kick_drift"
#define TALUS_CAN_REJECT "reject"
#define TALUS_CAN_CHECKPOINT "checkpoint"
#define TALUS_CAN_REHEARSAL "rehearsal"
#define TALUS_CAN_CONTACT_WEIGHT "contact_weight"
#define TALUS_CAN_MASS_FACTOR "mass_factor"
#define TALUS_CAN_POPULATION "population"
#define TALUS_CAN_SPRINGS "springs"
#define TALUS_CAN_DEAD_LOAD "dead_load"
#define TALUS_CAN_INITIAL_STRESS "initial_stress"
#define TALUS_CAN_QUAD_WEIGHT "quad_weight"
#define TALUS_CAN_MODULI "moduli"
#define TALUS_CAN_IMPULSE "impulse"
#define TALUS_CAN_PLACES "places"
#define TALUS_CAN_ELEMENT_STRESS "element_stress"
#define TALUS_CAN_PORE "pore"

/* scopes of FORCE */
#define TALUS_SCOPE_ALL "all"
#define TALUS_SCOPE_INTERFACE "interface"
#define TALUS_SCOPE_BALANCE "balance"
#define TALUS_SCOPE_LOADS "loads"
#define TALUS_SCOPE_SPLIT "split"
#define TALUS_SCOPE_BETWEEN "between"

/* what of DESCRIBE and SET */
#define TALUS_WHAT_GRAINS "grains"
#define TALUS_WHAT_CONTACTS "contacts"
#define TALUS_WHAT_BORDER "border"
#define TALUS_WHAT_ASLEEP "asleep"
#define TALUS_WHAT_MESH "mesh"
#define TALUS_WHAT_FACETS "facets"
#define TALUS_WHAT_QUADRATURE "quadrature"
#define TALUS_WHAT_MODULI "moduli"
#define TALUS_WHAT_PORE "pore"
#define TALUS_WHAT_GROUPS "groups"
#define TALUS_WHAT_GROUP "group"
#define TALUS_WHAT_CONTACT_WEIGHT "contact_weight"
#define TALUS_WHAT_KIND "kind"
#define TALUS_WHAT_PLACES "places"
#define TALUS_WHAT_MASS_FACTOR "mass_factor"
#define TALUS_WHAT_QUAD_WEIGHT "quad_weight"
#define TALUS_WHAT_INITIAL_STRESS "initial_stress"
#define TALUS_WHAT_SPRINGS "springs"
#define TALUS_WHAT_DEAD_LOAD "dead_load"
#define TALUS_WHAT_PORE_STORAGE "pore_storage"

/* fields; those of sets follow the name of the set and a dot */
#define TALUS_FIELD_A "a"
#define TALUS_FIELD_AHEAD "ahead"
#define TALUS_FIELD_ANALYSIS "analysis"
#define TALUS_FIELD_AREA "area"
#define TALUS_FIELD_AXES "axes"
#define TALUS_FIELD_BAND "band"
#define TALUS_FIELD_BORDER_OLD "border_old"
#define TALUS_FIELD_BRANCH "branch"
#define TALUS_FIELD_BRIEF "brief"
#define TALUS_FIELD_CAPABILITIES "capabilities"
#define TALUS_FIELD_COMPRESSIBILITY "compressibility"
#define TALUS_FIELD_CONDUCTANCE "conductance"
#define TALUS_FIELD_CONNECTIVITY "connectivity"
#define TALUS_FIELD_CONTENT "content"
#define TALUS_FIELD_COUPLE "couple"
#define TALUS_FIELD_COUPLE_STRESS "couple_stress"
#define TALUS_FIELD_DARCY "darcy"
#define TALUS_FIELD_DECK_HASH "deck_hash"
#define TALUS_FIELD_DENSITY "density"
#define TALUS_FIELD_DRIFT "drift"
#define TALUS_FIELD_DT "dt"
#define TALUS_FIELD_EARLY "early"
#define TALUS_FIELD_ELEMENT "element"
#define TALUS_FIELD_ENTERED "entered"
#define TALUS_FIELD_ERROR_CODE "error.code"
#define TALUS_FIELD_ERROR_HINT "error.hint"
#define TALUS_FIELD_ERROR_MESSAGE "error.message"
#define TALUS_FIELD_ERROR_PLACE "error.place"
#define TALUS_FIELD_EXPONENT "exponent"
#define TALUS_FIELD_FIELDS "fields"
#define TALUS_FIELD_FINAL "final"
#define TALUS_FIELD_FLOW_WORK "flow_work"
#define TALUS_FIELD_FLUID_IN "fluid_in"
#define TALUS_FIELD_FORCE "force"
#define TALUS_FIELD_GRAVITY "gravity"
#define TALUS_FIELD_GROUP "group"
#define TALUS_FIELD_GUEST "guest"
#define TALUS_FIELD_HASH "hash"
#define TALUS_FIELD_HELD "held"
#define TALUS_FIELD_HELD_PHI "held_phi"
#define TALUS_FIELD_HISTORY "history"
#define TALUS_FIELD_ID "id"
#define TALUS_FIELD_IDS "ids"
#define TALUS_FIELD_IMPULSE "impulse"
#define TALUS_FIELD_INERTIA "inertia"
#define TALUS_FIELD_ITERATIONS "iterations"
#define TALUS_FIELD_KICK "kick"
#define TALUS_FIELD_KIND "kind"
#define TALUS_FIELD_KNOTS "knots"
#define TALUS_FIELD_LAW "law"
#define TALUS_FIELD_LOAD "load"
#define TALUS_FIELD_MASS "mass"
#define TALUS_FIELD_MASS_PHI "mass_phi"
#define TALUS_FIELD_MASS_U "mass_u"
#define TALUS_FIELD_MATERIAL "material"
#define TALUS_FIELD_MEAN "mean"
#define TALUS_FIELD_MEAN_FORCE "mean_force"
#define TALUS_FIELD_MEAN_MOMENT "mean_moment"
#define TALUS_FIELD_MICRO_STRESS "micro_stress"
#define TALUS_FIELD_MICROMORPHIC "micromorphic"
#define TALUS_FIELD_MICROPOLAR "micropolar"
#define TALUS_FIELD_MOBILITY "mobility"
#define TALUS_FIELD_MODULI "moduli"
#define TALUS_FIELD_MOMENT "moment"
#define TALUS_FIELD_MOMENT_IMPULSE "moment_impulse"
#define TALUS_FIELD_MOTION "motion"
#define TALUS_FIELD_MOVED "moved"
#define TALUS_FIELD_NAMES "names"
#define TALUS_FIELD_NODE "node"
#define TALUS_FIELD_NODE_PHI "node_phi"
#define TALUS_FIELD_NORMAL "normal"
#define TALUS_FIELD_OMEGA "omega"
#define TALUS_FIELD_OVERLAP "overlap"
#define TALUS_FIELD_P "p"
#define TALUS_FIELD_PATH "path"
#define TALUS_FIELD_PHI "phi"
#define TALUS_FIELD_PHI_ACCELERATION "phi_acceleration"
#define TALUS_FIELD_PHI_RATE "phi_rate"
#define TALUS_FIELD_PLASTIC "plastic"
#define TALUS_FIELD_POINT "point"
#define TALUS_FIELD_POISSON "poisson"
#define TALUS_FIELD_POLAR "polar"
#define TALUS_FIELD_PRESSURE "pressure"
#define TALUS_FIELD_PROGRAM "program"
#define TALUS_FIELD_PROTOCOL "protocol"
#define TALUS_FIELD_QUAT "quat"
#define TALUS_FIELD_RADIUS "radius"
#define TALUS_FIELD_RANKS "ranks"
#define TALUS_FIELD_REACTION "reaction"
#define TALUS_FIELD_REACTION_MOMENT "reaction_moment"
#define TALUS_FIELD_REHEARSAL "rehearsal"
#define TALUS_FIELD_RESTART "restart"
#define TALUS_FIELD_ROLE "role"
#define TALUS_FIELD_RUN_ID "run_id"
#define TALUS_FIELD_SCALARS "scalars"
#define TALUS_FIELD_SCOPE "scope"
#define TALUS_FIELD_SET "set"
#define TALUS_FIELD_SKEW "skew"
#define TALUS_FIELD_SPEED "speed"
#define TALUS_FIELD_SPEED_PHI "speed_phi"
#define TALUS_FIELD_START "start"
#define TALUS_FIELD_STEADY "steady"
#define TALUS_FIELD_STEP_LIMIT "step_limit"
#define TALUS_FIELD_STEPS "steps"
#define TALUS_FIELD_STIFFNESS "stiffness"
#define TALUS_FIELD_STIFFNESS_PHI "stiffness_phi"
#define TALUS_FIELD_STORAGE "storage"
#define TALUS_FIELD_STRESS "stress"
#define TALUS_FIELD_STRETCH "stretch"
#define TALUS_FIELD_SUBSTEPS "substeps"
#define TALUS_FIELD_T_END "t_end"
#define TALUS_FIELD_TAG "tag"
#define TALUS_FIELD_TANGENT "tangent"
#define TALUS_FIELD_THETA "theta"
#define TALUS_FIELD_TILE "tile"
#define TALUS_FIELD_TIME "time"
#define TALUS_FIELD_TOLERANCE "tolerance"
#define TALUS_FIELD_TRIAL "trial"
#define TALUS_FIELD_TRIANGLE "triangle"
#define TALUS_FIELD_TURN "turn"
#define TALUS_FIELD_U "u"
#define TALUS_FIELD_UNBALANCED "unbalanced"
#define TALUS_FIELD_V "v"
#define TALUS_FIELD_VALUE "value"
#define TALUS_FIELD_VALUE_PHI "value_phi"
#define TALUS_FIELD_VERSION "version"
#define TALUS_FIELD_WEIGHT "weight"
#define TALUS_FIELD_WEIGHT_PHI "weight_phi"
#define TALUS_FIELD_WHAT "what"
#define TALUS_FIELD_WOKEN "woken"
#define TALUS_FIELD_WORK "work"
#define TALUS_FIELD_X "x"
#define TALUS_FIELD_YOUNG "young"

#endif
