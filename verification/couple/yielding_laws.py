"""Solids that yield around grains at some 100 kPa: lines of decks for a law and its section."""

SAND = """&material id = 'soil', law = 'sanisand', density = 1600.0, poisson = 0.05,
          stiffness_number = 125.0, critical_slope = 1.25, extension_ratio = 0.712,
          critical_void_ratio = 0.934, critical_line_slope = 0.019, plastic_hardening = 7.05,
          hardening_void = 0.968, bounding_rate = 1.1, dilatancy = 0.704, dilatancy_rate = 3.5,
          fabric_limit = 4.0, fabric_rate = 600.0, void_ratio = 0.8 /
"""
MICRO = """&micromorphic id = 'soil', density = 1600.0, micro_inertia = @j@, lambda = 8.0e6,
              mu = 10.0e6, eta = 20.0e6, tau = 2.5e6, kappa = 15.0e6, nu = 10.0e6, sigma = 5.0e6,
              taus = 0, 0, 0, 0, 0, 0, 10.0, 0, 0, 0, 0 /
"""
ELLIPSES = "".join(
    f"&cone level = '{level}', kind = 'ellipse', critical_slope = 1.2, preconsolidation = "
    f"{cap}, tension = 5.0e3, exponent = 30.0 /\n"
    for level, cap in (("macro", 1.3e5), ("micro", 1.4e5))
)
CRUSHING = """&cone level = 'macro', kind = 'breakage', critical_slope = 1.2, tension = 1.0e3,
      breakage_energy = 4.0e2, breakage_angle_deg = 60.0, grain_size_max = 2.0e-3,
      grain_size_min = 2.0e-5 /
"""
LAWS = {
    "sand": (SAND, "hex8_bbar"),
    "ellipse": (MICRO + ELLIPSES, "hex8/hex8"),
    "crushing": (MICRO + CRUSHING, "hex8/hex8"),
}  # material, element


def law_of(name: str, micro_inertia: float = 1.0e-5) -> str:
    """Return material 'soil' and the section of all elements; micro-inertia per mass [m2]."""
    material, element = LAWS[name]
    material = material.replace("@j@", f"{micro_inertia:g}")
    return material + f"&section group = 'all', material = 'soil', element = '{element}' /"
