"""What tests of grains are judged by: criteria in closed form, Bekker's law found again."""

from pathlib import Path

import numpy as np
import pytest

from talus import drivers
from talus.faults import FaultError


def test_angles_and_ratios() -> None:
    """30 degrees is a ratio of three, both ways."""
    assert drivers.ratio_of(30.0) == pytest.approx(3.0)
    assert drivers.angle_of(3.0) == pytest.approx(30.0)


def test_criteria() -> None:
    """Both go through compression; Matsuoka-Nakai touches Mohr-Coulomb in extension, Lade not."""
    for criterion in (drivers.lade, drivers.matsuoka_nakai):
        assert drivers.angle_by(criterion, 32.0, 0.0) == pytest.approx(32.0)
    assert drivers.angle_by(drivers.matsuoka_nakai, 32.0, 1.0) == pytest.approx(32.0)
    # Lade in extension: (1 + 2 K)^3/K^2 as (2 + k)^3/k in compression
    k = drivers.ratio_of(32.0)
    extension = drivers.ratio_of(drivers.angle_by(drivers.lade, 32.0, 1.0))
    assert (1.0 + 2.0 * extension) ** 3 / extension**2 == pytest.approx((2.0 + k) ** 3 / k)
    assert extension > k


def test_plane_strain() -> None:
    """With the criterion as potential s2 is the root of s1 s3, or the mean of both."""
    k = drivers.ratio_of(drivers.plane_strain_angle(drivers.matsuoka_nakai, 32.0))
    b = (np.sqrt(k) - 1.0) / (k - 1.0)
    assert drivers.angle_by(drivers.matsuoka_nakai, 32.0, b) == pytest.approx(
        drivers.angle_of(k), abs=1e-4
    )
    k = drivers.plane_strain_angle(drivers.lade, 32.0)
    assert drivers.angle_by(drivers.lade, 32.0, 0.5) == pytest.approx(k, abs=1e-9)


def test_direct_shear() -> None:
    """Davis: without dilation tan = sin of plane strain; with psi = phi it is the same angle."""
    assert np.tan(np.radians(drivers.direct_shear_angle(35.0, 0.0))) == pytest.approx(
        np.sin(np.radians(35.0))
    )
    assert drivers.direct_shear_angle(35.0, 35.0) == pytest.approx(35.0)


def test_shear_box(tmp_path: Path) -> None:
    """Sums over the upper half, lid less flange, the way of the lower half, the rise of the lid."""
    lines = ["time [s],surface [-],x [m],z [m],force_x [N],force_z [N]"]
    for k, t in enumerate((0.0, 1.0)):
        lines += [f"{t},1,{0.5 + 0.2 * k},0.1,-9.0,-{2 * k}.0", f"{t},2,0.7,0.1,{5 + k}.0,0.0",
                  f"{t},3,0.7,{0.3 + 0.01 * k},1.5,100.0"]  # fmt: skip
    (tmp_path / "run_surfaces.csv").write_text("\n".join(lines) + "\n")
    box = drivers.read_shear_box(tmp_path / "run_surfaces.csv", (2,), 3, 1)
    assert box.way == pytest.approx([0.0, 0.2])
    assert box.shear == pytest.approx([6.5, 7.5])
    assert box.normal == pytest.approx([100.0, 98.0])
    assert box.rise == pytest.approx([0.0, 0.01])
    with pytest.raises(FaultError, match="no surface 4"):
        drivers.read_shear_box(tmp_path / "run_surfaces.csv", (2, 4), 3, 1)


def test_bekker() -> None:
    """Curves that follow the law give its constants; a sinkage of zero is a fault."""
    z = np.linspace(0.005, 0.05, 30)
    law = drivers.Bekker(2.0e3, 9.0e5, 0.9, 0.0)
    curves = [(b, z, law.pressure(z, b)) for b in (0.03, 0.05)]
    found = drivers.bekker(curves)
    assert found.exponent == pytest.approx(0.9, abs=1e-9)
    assert [found.k_c, found.k_phi] == pytest.approx([2.0e3, 9.0e5], rel=1e-6)
    assert found.misfit < 1e-9
    alone = drivers.bekker(curves[:1])
    assert alone.k_c == 0.0
    assert alone.k_phi == pytest.approx(9.0e5 + 2.0e3 / 0.03, rel=1e-6)
    with pytest.raises(FaultError, match="E558"):
        drivers.bekker([(0.03, z - 0.005, z)])
