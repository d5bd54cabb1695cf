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
    BAND = "band"
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
    GUEST = "guest"
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
    OVERLAP = "overlap"
    P = "p"
    PATH = "path"
    PHI = "phi"
    PHI_ACCELERATION = "phi_acceleration"
    PHI_RATE = "phi_rate"
    PLASTIC = "plastic"
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
    TILE = "tile"
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
    WOKEN = "woken"
    WORK = "work"
    X = "x"
    YOUNG = "young"
