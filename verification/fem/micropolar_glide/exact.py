"""Glide of a Cosserat strip, tension of a block."""

import numpy as np
from solid import save

from talus.mesh import box
from talus.orders import converted
from talus.verification import Case, field_steps

Y = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
U = [0.0, -0.0486434231031, -0.202460967783, -0.486393340395, -0.946478682717, -1.65731741465]
PHI = [0.0, 0.410752325803, 0.888105982188, 1.50946135541, 2.3755679532, 3.62686040785]
M_YZ = [2.4, 2.59457369241, 3.20984387113, 4.34557336158, 6.18591473087, 9.0292696586]


def run(case: Case) -> None:
    """Judge both tests; plot the strip."""
    for element, cells in (("hex20/hex20", 40), ("hex20/hex8", 120)):
        mesh = converted(box(np.zeros(3), np.array([0.05, 1.0, 0.05]), (1, cells, 1)), "hex20")
        save(mesh, case.folder / "strip.h5")
        name = element.replace("/", "_")
        text = (case.folder / "glide.nml").read_text().replace("hex20/hex8", element)
        (case.folder / f"{name}.nml").write_text(text)
        case.run("talus-fem", f"{name}.nml")
        found = field_steps(case.folder / f"{name}.h5")[-1].solid
        line = np.isclose(mesh.x[:, 0], 0.0) & np.isclose(mesh.x[:, 2], 0.0)
        nodes = [int(np.flatnonzero(line & np.isclose(mesh.x[:, 1], y))[0]) for y in Y]
        u, phi = found["u"][nodes, 0], found["phi"][nodes, 2]
        off = float(abs(u - U).max() / abs(u).max())
        case.below(f"glide, {cells} {element}: u_x, error / largest", off, 1e-5)
        off = float(abs(phi - PHI).max() / abs(phi).max())
        case.below(f"glide, {cells} {element}: phi_z, error / largest", off, 1e-5)
    couple = found["couple_stress_nodal"][nodes, 5]
    error = float(abs(couple - M_YZ)[1:-1].max() / M_YZ[-1])
    case.below("glide: m_yz at inner nodes, error / largest", error, 2e-3)
    sigma = found["stress_points"]
    case.below(
        "glide: |sigma_yx| / largest sigma_xy",
        float(abs(sigma[:, 3]).max() / abs(sigma[:, 1]).max()),
        2e-3,
    )
    size = np.array([1.0, 1.0, 0.2])
    mesh = converted(box(np.zeros(3), size, (2, 2, 1)), "hex20")
    save(mesh, case.folder / "block.h5")
    case.run("talus-fem", "tension.nml")
    last = field_steps(case.folder / "tension.h5")[-1].solid
    top = np.isclose(mesh.x[:, 1], 1.0)
    error = float(abs(last["u"][top, 1] - 3 / 14).max())
    case.below("tension: |u_y - 3/14| [m]", error, 1e-10)
    case.below("tension: largest micro-rotation", float(abs(last["phi"]).max()), 1e-12)
    fig, ax = case.figure()
    ax.plot(PHI, Y, "k_", ms=12, label="micro-rotation [rad], exact")
    ax.plot(phi, Y, "o", ms=5, label="Talus")
    ax.plot(U, Y, "k|", ms=12, label="displacement [m], exact")
    ax.plot(u, Y, "s", ms=4, mfc="none", label="Talus")
    ax.set(xlabel="displacement [m], micro-rotation [rad]", ylabel="y [m]")
    ax.legend()
    case.save(fig)
