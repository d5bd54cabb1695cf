"""What textbooks give for the force on a blade that cuts soil without cohesion.

McKyes and Ali (1977, J. Terramechanics 14, 43; McKyes, Soil Cutting and Tillage, 1985): a wedge
before the blade and a crescent on each side. Gill and Vanden Berg (1968, Soil Dynamics in Tillage
and Traction, USDA Handbook 316, after Soehne): a wedge of the blade's width with the soil that lies
on the blade, and its inertia.
"""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81


@dataclass(frozen=True)
class Soil:
    """Density of the bulk [kg/m3], friction in the soil and on the blade [rad]."""

    density: float
    friction: float
    steel: float


@dataclass(frozen=True)
class Blade:
    """Width, depth [m], rake to the horizontal [rad], length of face under soil [m], speed [m/s]."""

    width: float
    depth: float
    rake: float
    length: float
    speed: float


def mckyes(soil: Soil, blade: Blade, way: float = 0.0, sides: bool = True) -> np.ndarray:
    """Return force along the motion and upwards on the soil [N] at the slip angle of least force.

    The soil that the blade has moved through its way [m] lies on the wedge as a heap. Without
    sides the wedge is as wide as the blade. Soil that slips is brought to the speed that takes it
    along the slip plane ahead of the blade.
    """
    slip = np.radians(np.linspace(5.0, 85.0, 3201))
    ahead = 1.0 / np.tan(blade.rake) + 1.0 / np.tan(slip)  # length of the wedge over its depth
    flank = np.sqrt(np.maximum(ahead**2 - np.tan(blade.rake) ** -2, 0.0)) / ahead
    crescents = 2.0 / 3.0 * ahead * blade.depth / blade.width * flank if sides else 0.0
    weight = 0.5 * ahead * (1.0 + crescents) + way / blade.depth
    weight = weight * soil.density * GRAVITY * blade.depth**2 * blade.width
    pushed = soil.density * blade.width * blade.depth * blade.speed**2
    pushed = pushed * np.sin(blade.rake) / np.sin(blade.rake + slip)
    weight = weight + pushed * (np.sin(slip) + np.cos(slip) / np.tan(slip + soil.friction))
    across = 1.0 / np.tan(blade.rake + soil.steel) + 1.0 / np.tan(slip + soil.friction)
    draft = np.where(across > 0.0, weight / np.where(across > 0.0, across, 1.0), np.inf)
    least = draft.min()
    return np.array([least, least / np.tan(blade.rake + soil.steel)])


def gill_vanden_berg(soil: Soil, blade: Blade) -> float:
    """Return the draft [N]: the soil before the blade slips at 45 degrees less half the friction."""
    slip = 0.25 * np.pi - 0.5 * soil.friction
    rake, rub, own = blade.rake, np.tan(soil.steel), np.tan(soil.friction)
    thick = blade.depth * np.sin(rake + slip) / np.sin(slip)
    front = blade.depth * np.cos(rake + slip) / np.sin(slip)
    weight = soil.density * GRAVITY * blade.width * thick
    weight *= blade.length + 0.5 * (front + thick * np.tan(rake))
    moved = soil.density * blade.width * blade.depth * blade.speed**2
    moved *= np.sin(rake) / np.sin(rake + slip)
    on_slip = np.sin(slip) + own * np.cos(slip)
    turned = (np.cos(rake) - rub * np.sin(rake)) / (np.sin(rake) + rub * np.cos(rake))
    turned += (np.cos(slip) - own * np.sin(slip)) / on_slip
    return float(weight / turned + moved / (turned * on_slip))
