"""Names and numbers of the exchange port (manual/port.md).

Made by tools/port.py from common/port/port.toml: change that file, then `make port`.
"""

# fmt: off
MAGIC = b"TALUSMSG"
PROTOCOL = 2
HEADER_WORDS, FIELD_WORDS = 16, 10
NAME_LENGTH, SCALAR_COUNT = 48, 19

# verbs
VERBS = {
    "HELLO": 1, "DESCRIBE": 2, "SELECT": 3, "SET": 4, "READY": 5, "ADVANCE": 6, "SOLVE": 7,
    "FORCE": 8, "KICK_DRIFT": 9, "ACCEPT": 10, "REJECT": 11, "CHECKPOINT": 12, "WRITE": 13,
    "STOP": 14, "ABORT": 15, "WAKE": 16, "SLEEP": 17, "RELAX": 18,
}

# kinds of fields
KINDS = {"real": 1, "integer": 2, "text": 3}

# status of a reply, and exit codes
STATUS = {"good": 0, "input": 1, "numerical": 2, "stopped": 3, "system": 4, "bug": 5}

# kinds of elements and facets
CELLS = {
    "hex8": 1, "hex20": 2, "hex27": 3, "tet4": 4, "tet10": 5, "wedge6": 6, "quad4": 7,
    "quad8": 8, "quad9": 9, "tri3": 10, "tri6": 11,
}

# health flags
FLAGS = {"late_rebuild": 1, "large_overlap": 2}

# words of the header, from 0
HEADER = {
    "magic": 0, "protocol": 1, "sequence": 2, "verb": 3, "step": 4, "t0": 5, "t1": 6,
    "status": 7, "fields": 8, "words": 9, "checksum": 10, "waited": 11,
}

# first place of each scalar, from 0
SCALARS = {
    "kinetic": 0, "elastic": 1, "friction": 2, "contact_damping": 3, "background_damping": 4,
    "curvature": 5, "tangential_relaxation": 6, "plastic": 7, "boundary": 8, "gravity": 9,
    "momentum": 10, "angular_momentum": 13, "step_limit": 16, "max_overlap": 17, "flags": 18,
}

# unit of each scalar
SCALAR_UNITS = {
    "kinetic": "J",
    "elastic": "J",
    "friction": "J",
    "contact_damping": "J",
    "background_damping": "J",
    "curvature": "J",
    "tangential_relaxation": "J",
    "plastic": "J",
    "boundary": "J",
    "gravity": "J",
    "momentum": "kg m/s",
    "angular_momentum": "N m s",
    "step_limit": "s",
    "max_overlap": "1",
    "flags": "1",
}

# roles of sets
ROLES = (
    "report", "prescribe", "load", "surface", "border", "pore",
)

# words of HELLO's capabilities
CAPABILITIES = (
    "report", "prescribe", "load", "surface", "border", "advance", "solve", "force",
    "kick_drift", "reject", "checkpoint", "rehearsal", "contact_weight", "mass_factor",
    "population", "springs", "dead_load", "initial_stress", "quad_weight", "moduli", "impulse",
    "places", "element_stress", "pore",
)

# scopes of FORCE
SCOPES = (
    "all", "interface", "balance", "loads", "split", "between",
)

WHATS = (
    "grains", "contacts", "border", "asleep", "mesh", "facets", "quadrature", "moduli", "pore",
    "groups", "group", "contact_weight", "kind", "places", "mass_factor", "quad_weight",
    "initial_stress", "springs", "dead_load", "pore_storage",
)


class Field:
    """Names of fields; of sets the part behind the dot."""

    A = "a"
    AHEAD = "ahead"
    ANALYSIS = "analysis"
    AREA = "area"
    AXES = "axes"
    BORDER_OLD = "border_old"
    BRANCH = "branch"
    BRIEF = "brief"
    CAPABILITIES = "capabilities"
    COMPRESSIBILITY = "compressibility"
    CONDUCTANCE = "conductance"
    CONNECTIVITY = "connectivity"
    CONTENT = "content"
    COUPLE = "couple"
    COUPLE_STRESS = "couple_stress"
    DARCY = "darcy"
    DECK_HASH = "deck_hash"
    DENSITY = "density"
    DRIFT = "drift"
    DT = "dt"
    EARLY = "early"
    ELEMENT = "element"
    ENTERED = "entered"
    ERROR_CODE = "error.code"
    ERROR_HINT = "error.hint"
    ERROR_MESSAGE = "error.message"
    ERROR_PLACE = "error.place"
    EXPONENT = "exponent"
    FIELDS = "fields"
    FINAL = "final"
    FLOW_WORK = "flow_work"
    FLUID_IN = "fluid_in"
    FORCE = "force"
    GRAVITY = "gravity"
    GROUP = "group"
    HASH = "hash"
    HELD = "held"
    HELD_PHI = "held_phi"
    HISTORY = "history"
    ID = "id"
    IDS = "ids"
    IMPULSE = "impulse"
    INERTIA = "inertia"
    ITERATIONS = "iterations"
    KICK = "kick"
    KIND = "kind"
    KNOTS = "knots"
    LAW = "law"
    LOAD = "load"
    MASS = "mass"
    MASS_PHI = "mass_phi"
    MASS_U = "mass_u"
    MATERIAL = "material"
    MEAN = "mean"
    MEAN_FORCE = "mean_force"
    MEAN_MOMENT = "mean_moment"
    MICRO_STRESS = "micro_stress"
    MICROMORPHIC = "micromorphic"
    MICROPOLAR = "micropolar"
    MOBILITY = "mobility"
    MODULI = "moduli"
    MOMENT = "moment"
    MOMENT_IMPULSE = "moment_impulse"
    MOTION = "motion"
    MOVED = "moved"
    NAMES = "names"
    NODE = "node"
    NODE_PHI = "node_phi"
    NORMAL = "normal"
    OMEGA = "omega"
    P = "p"
    PATH = "path"
    PHI = "phi"
    PHI_ACCELERATION = "phi_acceleration"
    PHI_RATE = "phi_rate"
    POINT = "point"
    POISSON = "poisson"
    POLAR = "polar"
    PRESSURE = "pressure"
    PROGRAM = "program"
    PROTOCOL = "protocol"
    QUAT = "quat"
    RADIUS = "radius"
    RANKS = "ranks"
    REACTION = "reaction"
    REACTION_MOMENT = "reaction_moment"
    REHEARSAL = "rehearsal"
    RESTART = "restart"
    ROLE = "role"
    RUN_ID = "run_id"
    SCALARS = "scalars"
    SCOPE = "scope"
    SET = "set"
    SKEW = "skew"
    SPEED = "speed"
    SPEED_PHI = "speed_phi"
    START = "start"
    STEADY = "steady"
    STEP_LIMIT = "step_limit"
    STEPS = "steps"
    STIFFNESS = "stiffness"
    STIFFNESS_PHI = "stiffness_phi"
    STORAGE = "storage"
    STRESS = "stress"
    STRETCH = "stretch"
    SUBSTEPS = "substeps"
    T_END = "t_end"
    TAG = "tag"
    TANGENT = "tangent"
    THETA = "theta"
    TIME = "time"
    TOLERANCE = "tolerance"
    TRIAL = "trial"
    TRIANGLE = "triangle"
    TURN = "turn"
    U = "u"
    UNBALANCED = "unbalanced"
    V = "v"
    VALUE = "value"
    VALUE_PHI = "value_phi"
    VERSION = "version"
    WEIGHT = "weight"
    WEIGHT_PHI = "weight_phi"
    WHAT = "what"
    WORK = "work"
    X = "x"
    YOUNG = "young"


# (name, kind, shape, side, required) of the fields of every request; sets: SET_REQUESTS
REQUESTS = {
    "HELLO": (
        ("run_id", "text", "text", "both", True),
        ("restart", "text", "text", "both", True),
        ("protocol", "integer", "(1)", "both", True),
    ),
    "DESCRIBE": (("what", "text", "text", "both", True), ("group", "text", "text", "both", False),),
    "SELECT": (
        ("set", "text", "text", "both", True),
        ("role", "text", "text", "both", True),
        ("id", "integer", "(set)", "both", True),
        ("fields", "text", "text", "both", False),
        ("x", "real", "(3, set)", "grains", False),
        ("triangle", "integer", "(3, triangles)", "grains", False),
        ("material", "text", "text", "grains", False),
    ),
    "SET": (("what", "text", "text", "both", True),),
    "READY": (("rehearsal", "integer", "(1)", "both", False),),
    "ADVANCE": (),
    "SOLVE": (("trial", "integer", "(1)", "both", False),),
    "FORCE": (
        ("scope", "text", "text", "both", False),
        ("set", "text", "text", "solid", False),
        ("brief", "integer", "(1)", "both", False),
    ),
    "KICK_DRIFT": (
        ("kick", "real", "(1)", "both", True),
        ("drift", "real", "(1)", "both", True),
        ("brief", "integer", "(1)", "both", False),
        ("ahead", "integer", "(1)", "grains", False),
    ),
    "ACCEPT": (("final", "integer", "(1)", "both", False),),
    "REJECT": (),
    "CHECKPOINT": (("tag", "text", "text", "both", False),),
    "WRITE": (("tag", "text", "text", "both", False),),
    "STOP": (("early", "integer", "(1)", "both", False),),
    "ABORT": (),
    "WAKE": (
        ("id", "integer", "(given)", "both", True),
        ("kind", "integer", "(given)", "both", False),
        ("material", "text", "text", "both", False),
        ("x", "real", "(3, given)", "both", False),
        ("quat", "real", "(4, given)", "both", False),
        ("axes", "real", "(3, given)", "both", False),
        ("skew", "real", "(3, given)", "both", False),
        ("exponent", "real", "(given)", "both", False),
        ("v", "real", "(3, given)", "both", False),
        ("omega", "real", "(3, given)", "both", False),
        ("ids", "integer", "(2, contacts)", "both", False),
        ("force", "real", "(3, contacts)", "both", False),
        ("turn", "real", "(4, given)", "both", False),
        ("history", "integer", "(given)", "both", False),
        ("knots", "integer", "(histories)", "both", False),
        ("stretch", "real", "(9, knots)", "both", False),
    ),
    "SLEEP": (("id", "integer", "(given)", "both", True),),
    "RELAX": (
        ("id", "integer", "(given)", "both", True),
        ("steps", "integer", "(1)", "both", True),
        ("tolerance", "real", "(1)", "both", True),
    ),
    "SET contact_weight": (
        ("ids", "integer", "(2, given)", "both", True),
        ("value", "real", "(given)", "both", True),
    ),
    "SET kind": (
        ("id", "integer", "(given)", "both", True),
        ("kind", "integer", "(given)", "both", True),
        ("v", "real", "(3, given)", "both", False),
    ),
    "SET places": (
        ("node", "integer", "(given)", "both", True),
        ("x", "real", "(3, given)", "both", True),
    ),
    "SET mass_factor": (
        ("set", "text", "text", "both", True),
        ("value", "real", "(set)", "both", True),
        ("value_phi", "real", "(set)", "solid", False),
    ),
    "SET quad_weight": (("value", "real", "(points)", "both", True),),
    "SET initial_stress": (
        ("value", "real", "(6 or 9, points)", "both", True),
        ("element", "integer", "(given)", "both", False),
        ("density", "real", "(given)", "both", False),
        ("couple", "real", "(9, points)", "both", False),
    ),
    "SET moduli": (
        ("element", "integer", "(given)", "both", True),
        ("young", "real", "(given)", "both", False),
        ("poisson", "real", "(given)", "both", False),
        ("micropolar", "real", "(6, given)", "both", False),
    ),
    "SET springs": (
        ("node", "integer", "(nodes of a facet, springs)", "both", True),
        ("weight", "real", "(nodes of a facet, springs)", "both", True),
        ("stiffness", "real", "(springs)", "both", True),
        ("node_phi", "integer", "(nodes of a facet, springs)", "both", False),
        ("weight_phi", "real", "(nodes of a facet, springs)", "both", False),
        ("stiffness_phi", "real", "(springs)", "both", False),
    ),
    "SET dead_load": (
        ("set", "text", "text", "both", True),
        ("force", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
    ),
    "SET pore_storage": (
        ("set", "text", "text", "both", True),
        ("value", "real", "(set)", "both", True),
    ),
}

# (name, kind, shape, side, required) of the fields of every reply; sets: SET_REPLIES
REPLIES = {
    "HELLO": (
        ("program", "text", "text", "both", True),
        ("version", "text", "text", "both", True),
        ("deck_hash", "text", "text", "both", True),
        ("capabilities", "text", "text", "both", True),
        ("gravity", "real", "(3)", "both", True),
        ("time", "real", "(1)", "both", True),
        ("t_end", "real", "(1)", "both", True),
        ("step_limit", "real", "(1)", "both", True),
        ("ranks", "integer", "(1)", "both", True),
        ("dt", "real", "(1)", "both", False),
        ("motion", "real", "(3)", "grains", False),
        ("analysis", "text", "text", "solid", False),
    ),
    "DESCRIBE": (),
    "SELECT": (
        ("mass", "real", "(set)", "both", True),
        ("stiffness", "real", "(set)", "both", True),
        ("held", "integer", "(3, set)", "solid", True),
        ("speed", "real", "(3, set)", "solid", True),
        ("inertia", "real", "(set)", "solid", False),
        ("stiffness_phi", "real", "(set)", "solid", False),
        ("held_phi", "integer", "(3, set)", "solid", False),
        ("speed_phi", "real", "(3, set)", "solid", False),
    ),
    "SET": (("step_limit", "real", "(1)", "both", True),),
    "READY": (
        ("substeps", "integer", "(1)", "grains", True),
        ("iterations", "integer", "(1)", "solid", True),
        ("scalars", "real", "(19)", "both", True),
    ),
    "ADVANCE": (
        ("substeps", "integer", "(1)", "both", True),
        ("scalars", "real", "(19)", "both", True),
    ),
    "SOLVE": (
        ("iterations", "integer", "(1)", "both", True),
        ("scalars", "real", "(19)", "both", True),
    ),
    "FORCE": (
        ("steady", "integer", "(1)", "solid", False),
        ("border_old", "integer", "(1)", "grains", False),
        ("scalars", "real", "(19)", "both", False),
    ),
    "KICK_DRIFT": (("scalars", "real", "(19)", "both", False),),
    "ACCEPT": (),
    "REJECT": (),
    "CHECKPOINT": (("path", "text", "text", "both", True), ("hash", "text", "text", "both", True),),
    "WRITE": (("path", "text", "text", "both", True),),
    "STOP": (),
    "ABORT": (),
    "WAKE": (
        ("step_limit", "real", "(1)", "both", True),
        ("stress", "real", "(9, histories)", "both", False),
        ("pressure", "real", "(1)", "both", False),
        ("substeps", "integer", "(1)", "both", False),
    ),
    "SLEEP": (("step_limit", "real", "(1)", "both", True),),
    "RELAX": (
        ("substeps", "integer", "(1)", "both", True),
        ("unbalanced", "real", "(1)", "both", True),
        ("moved", "real", "(1)", "both", True),
        ("step_limit", "real", "(1)", "both", True),
    ),
    "DESCRIBE grains": (
        ("id", "integer", "(grains)", "both", True),
        ("x", "real", "(3, grains)", "both", True),
        ("quat", "real", "(4, grains)", "both", True),
        ("axes", "real", "(3, grains)", "both", True),
        ("radius", "real", "(grains)", "both", True),
        ("mass", "real", "(grains)", "both", True),
        ("inertia", "real", "(3, grains)", "both", True),
        ("kind", "integer", "(grains)", "both", True),
    ),
    "DESCRIBE contacts": (
        ("ids", "integer", "(2, contacts)", "both", True),
        ("point", "real", "(3, contacts)", "both", True),
        ("normal", "real", "(3, contacts)", "both", True),
        ("branch", "real", "(3, contacts)", "both", True),
        ("force", "real", "(3, contacts)", "both", True),
        ("stiffness", "real", "(2, contacts)", "both", True),
    ),
    "DESCRIBE border": (("id", "integer", "(members)", "both", True),),
    "DESCRIBE asleep": (
        ("id", "integer", "(members)", "both", True),
        ("x", "real", "(3, members)", "both", True),
    ),
    "DESCRIBE mesh": (
        ("id", "integer", "(nodes)", "both", True),
        ("x", "real", "(3, nodes)", "both", True),
        ("mass_u", "real", "(nodes)", "both", True),
        ("kind", "integer", "(elements)", "both", True),
        ("start", "integer", "(elements + 1)", "both", True),
        ("node", "integer", "(corners)", "both", True),
        ("connectivity", "integer", "(8, elements)", "both", False),
        ("mass_phi", "real", "(nodes)", "both", False),
        ("polar", "integer", "(nodes)", "both", False),
        ("micromorphic", "integer", "(nodes)", "both", False),
    ),
    "DESCRIBE facets": (
        ("connectivity", "integer", "(nodes of a facet, facets)", "both", True),
        ("kind", "integer", "(facets)", "both", True),
    ),
    "DESCRIBE quadrature": (
        ("x", "real", "(3, points)", "both", True),
        ("weight", "real", "(points)", "both", True),
        ("stress", "real", "(6 or 9, points)", "both", True),
        ("couple_stress", "real", "(9 or 27, points)", "both", False),
        ("micro_stress", "real", "(9, points)", "both", False),
        ("element", "integer", "(points)", "both", True),
    ),
    "DESCRIBE moduli": (
        ("moduli", "real", "(6, elements)", "both", True),
        ("mean", "integer", "(elements)", "both", True),
        ("law", "integer", "(elements)", "both", False),
        ("tangent", "real", "(2025, laws)", "both", False),
    ),
    "DESCRIBE pore": (
        ("id", "integer", "(hull)", "both", True),
        ("x", "real", "(3, hull)", "grains", True),
        ("area", "real", "(6, hull)", "grains", True),
        ("storage", "real", "(hull)", "grains", True),
        ("mobility", "real", "(hull)", "both", True),
        ("compressibility", "real", "(hull)", "both", True),
    ),
    "DESCRIBE groups": (("names", "text", "text", "both", True),),
    "DESCRIBE group": (
        ("id", "integer", "(members)", "both", True),
        ("element", "integer", "(given)", "solid", False),
    ),
}

# fields of sets in a request: 'side role'
SET_REQUESTS = {
    "grains prescribe": (
        ("x", "real", "(3, set)", "both", False),
        ("quat", "real", "(4, set)", "both", False),
        ("v", "real", "(3, set)", "both", False),
        ("omega", "real", "(3, set)", "both", False),
    ),
    "grains load": (
        ("force", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
        ("mean_force", "real", "(3, set)", "both", False),
        ("mean_moment", "real", "(3, set)", "both", False),
    ),
    "grains report": (),
    "grains border": (
        ("x", "real", "(3, set)", "both", False),
        ("quat", "real", "(4, set)", "both", False),
        ("v", "real", "(3, set)", "both", False),
        ("omega", "real", "(3, set)", "both", False),
    ),
    "grains surface": (
        ("x", "real", "(3, set)", "both", False),
        ("v", "real", "(3, set)", "both", False),
    ),
    "solid prescribe": (
        ("u", "real", "(3, set)", "both", False),
        ("v", "real", "(3, set)", "both", False),
        ("phi", "real", "(3, set)", "both", False),
    ),
    "solid load": (
        ("force", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
        ("impulse", "real", "(3, set)", "both", False),
    ),
    "solid report": (),
    "grains pore": (
        ("p", "real", "(set)", "both", False),
        ("conductance", "real", "(set)", "both", False),
        ("fluid_in", "real", "(set)", "both", False),
        ("v", "real", "(3, set)", "both", False),
    ),
    "solid pore": (("fluid_in", "real", "(set)", "both", False),),
}

# fields of sets in a reply: 'side role'
SET_REPLIES = {
    "grains prescribe": (
        ("force", "real", "(3, set)", "both", True),
        ("moment", "real", "(3, set)", "both", True),
        ("impulse", "real", "(3, set)", "both", True),
        ("moment_impulse", "real", "(3, set)", "both", True),
        ("work", "real", "(1)", "both", True),
    ),
    "grains load": (
        ("force", "real", "(3, set)", "both", True),
        ("moment", "real", "(3, set)", "both", True),
        ("load", "real", "(3, set)", "both", False),
    ),
    "grains report": (
        ("x", "real", "(3, set)", "both", True),
        ("quat", "real", "(4, set)", "both", True),
        ("v", "real", "(3, set)", "both", True),
        ("omega", "real", "(3, set)", "both", True),
        ("theta", "real", "(3, set)", "both", True),
        ("force", "real", "(3, set)", "both", True),
        ("moment", "real", "(3, set)", "both", True),
        ("load", "real", "(3, set)", "both", False),
    ),
    "grains border": (
        ("force", "real", "(3, set)", "both", True),
        ("moment", "real", "(3, set)", "both", True),
    ),
    "grains surface": (
        ("force", "real", "(3, set)", "both", True),
        ("impulse", "real", "(3, set)", "both", True),
        ("work", "real", "(1)", "both", True),
    ),
    "solid prescribe": (
        ("u", "real", "(3, set)", "both", True),
        ("v", "real", "(3, set)", "both", True),
        ("a", "real", "(3, set)", "both", True),
        ("reaction", "real", "(3, set)", "both", True),
        ("impulse", "real", "(3, set)", "both", True),
        ("work", "real", "(1)", "both", True),
        ("force", "real", "(3, set)", "both", True),
        ("phi", "real", "(3, set)", "both", False),
        ("phi_rate", "real", "(3, set)", "both", False),
        ("phi_acceleration", "real", "(3, set)", "both", False),
        ("reaction_moment", "real", "(3, set)", "both", False),
        ("moment_impulse", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
    ),
    "solid load": (
        ("u", "real", "(3, set)", "both", True),
        ("v", "real", "(3, set)", "both", True),
        ("a", "real", "(3, set)", "both", True),
        ("force", "real", "(3, set)", "both", True),
        ("phi", "real", "(3, set)", "both", False),
        ("phi_rate", "real", "(3, set)", "both", False),
        ("phi_acceleration", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
    ),
    "solid report": (
        ("u", "real", "(3, set)", "both", True),
        ("v", "real", "(3, set)", "both", True),
        ("a", "real", "(3, set)", "both", True),
        ("force", "real", "(3, set)", "both", True),
        ("phi", "real", "(3, set)", "both", False),
        ("phi_rate", "real", "(3, set)", "both", False),
        ("phi_acceleration", "real", "(3, set)", "both", False),
        ("moment", "real", "(3, set)", "both", False),
    ),
    "grains pore": (
        ("force", "real", "(3, set)", "both", True),
        ("fluid_in", "real", "(set)", "both", True),
        ("work", "real", "(1)", "both", True),
        ("content", "real", "(1)", "both", True),
        ("entered", "real", "(1)", "both", True),
        ("flow_work", "real", "(1)", "both", True),
        ("darcy", "real", "(1)", "both", True),
    ),
    "solid pore": (
        ("p", "real", "(set)", "both", True),
        ("content", "real", "(1)", "both", True),
        ("entered", "real", "(1)", "both", True),
        ("flow_work", "real", "(1)", "both", True),
        ("darcy", "real", "(1)", "both", True),
    ),
}
