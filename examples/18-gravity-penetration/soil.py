"""Constants of the surround from an element test of this bed, by the means of example 07.

Usage: soil.py OUT, in which prepare.py has cut the bed. A box is cut out of the middle of the bed,
comes between smooth walls under the stress that it had at half its depth, and is shortened along x
while the other walls hold theirs. Writes OUT/soil/soil.json and soil.png.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

EXAMPLES = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(EXAMPLES / "07-overlap-penetration"))

import soil as means  # noqa: E402

from talus.packing import FREE, read_packing, write_packing_file  # noqa: E402
from talus.secant import secant_at, strain_beside  # noqa: E402
from talus.specimens import read_specimen  # noqa: E402

LOW, HIGH = 0.004, 0.036  # ends of the sample in the bed [m]
SPEED, SHORTER = 0.02, 0.06  # of the wall [m/s], strain at the end of the test
DENSITY, GRAVITY = 1600.0, 9.81  # of the bed [kg/m3], [m/s2]
LEVEL = 0.5  # horizontal over vertical stress
CHANGES = {"2.9e9": "2.9e7", "t_end = 0.1 ": "t_end = 0.6 ", "damping = 50.0": "damping = 20.0",
           "velocity = -0.1": f"velocity = -{SPEED}", "every_time = 2.5e-4": "every_time = 1.0e-3",
           "speed = 0.3, tol": "speed = 0.1, tol", "gain = 0.3": "gain = 1.0"}  # fmt: skip
STROKE, HEIGHT = 0.020, 0.040  # of the tool, of the free zone [m]


def deck(out: Path, name: str, values: dict[str, float]) -> None:
    """Write a deck of example 07 for these grains and this speed."""
    means.fill(out, name, values)
    text = (out / name).read_text()
    for old, new in CHANGES.items():
        text = text.replace(old, new)
    (out / name).write_text(text)


def solve(out: Path, name: str, *words: str) -> None:
    """Run talus-dem on a deck."""
    binary = Path(means.__file__).parents[2] / "build/bin/talus-dem"
    subprocess.run([binary, name, "--threads=1", *words], cwd=out, check=True)


def main() -> int:
    """Cut, bring to rest, shorten, and say what the soil is."""
    out = Path(sys.argv[1]) / "soil"
    out.mkdir(exist_ok=True)
    bed = read_packing(out.parent / "all_pack.h5")
    bed = bed.take(bed.kind == FREE)
    upright = DENSITY * GRAVITY * (float(np.quantile(bed.x[:, 2], 0.99)) - 0.5 * (LOW + HIGH))
    stress = [-LEVEL * upright, -LEVEL * upright, -upright, 0.0, 0.0, 0.0]
    (out / "probe_probe.json").write_text(json.dumps({"stress_Pa": stress}))
    write_packing_file(out / "pressed.h5", bed)
    means.LOW, means.HIGH, means.SPEED, means.SHORTER = LOW, HIGH, SPEED, SHORTER
    means.cut(out)
    deck(out, "sample.nml", means.stresses(out))
    solve(out, "sample.nml")
    began = json.loads((out / "sample_summary.json").read_text())["time_s"]
    end = began + SHORTER * 2.0 * (means.HALF + means.ROOM) / SPEED
    deck(out, "shear.nml", means.stresses(out) | {"end": end})
    solve(out, "shear.nml", "--restart=sample.chk.h5")
    soil = means.fit(out) | {"vertical_stress_Pa": upright}
    sides = 8.0 * means.RADIUS * HEIGHT
    strain = strain_beside(float(means.displaced(STROKE)), sides, means.RADIUS)
    found = secant_at(read_specimen(out / "shear_walls.csv", "x"), strain)
    soil |= {"strain_beside": strain, "young_beside_Pa": found.young_Pa,
             "poisson_beside": found.poisson, "of_strength_beside": found.of_strength}  # fmt: skip
    (out / "soil.json").write_text(json.dumps(soil, indent=2) + "\n")
    means.draw(out, soil)
    print(", ".join(f"{name} {value:.4g}" for name, value in soil.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
