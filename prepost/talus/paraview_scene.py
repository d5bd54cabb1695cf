"""A scene for ParaView: grains as ellipsoids, turned and scaled, and the solid around them."""

from pathlib import Path

from talus.faults import FaultError
from talus.fields import FieldFile
from talus.files import write_text_file

HEAD = '''"""{title}

Written by talus convert --to paraview. Open it with  paraview --script={name}  or, for a picture
without a screen,  xvfb-run pvpython {name} picture.png.
"""

import sys
from pathlib import Path

from paraview.simple import *

HERE = Path(__file__).resolve().parent if "__file__" in globals() else Path({folder!r})
view = GetActiveViewOrCreate("RenderView")
view.ViewSize = [1280, 960]
'''
# axes and quaternion become the symmetric tensor whose glyph is the grain: manual, Files
GRAINS = '''
grains = XDMFReader(registrationName="grains", FileNames=[str(HERE / {file!r})])
tensors = ProgrammableFilter(registrationName="ellipsoids", Input=grains)
tensors.CopyArrays = 1
tensors.Script = """
import numpy as np

points = inputs[0].PointData
w, x, y, z = (np.asarray(points["quat_" + part]) for part in "wxyz")
turn = np.array([
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
])
tensor = np.einsum("ijn,nj,kjn->nik", turn, np.asarray(points["axes"]), turn)
output.PointData.append(tensor.reshape(-1, 9), "ellipsoid")
output.PointData.append(np.linalg.norm(np.asarray(points["v"]), axis=1), "speed")
"""
glyphs = TensorGlyph(registrationName="shapes", Input=tensors, GlyphType="Sphere")
glyphs.Tensors = ["POINTS", "ellipsoid"]
glyphs.Scalars = ["POINTS", "speed"]
glyphs.ExtractEigenvalues = 1
glyphs.ScaleFactor = 1.0
glyphs.GlyphType.Radius = 1.0
glyphs.GlyphType.ThetaResolution = 16
glyphs.GlyphType.PhiResolution = 12
shown = Show(glyphs, view)
ColorBy(shown, ("POINTS", "speed"))
shown.SetScalarBarVisibility(view, True)
'''
SOLID = """
solid = XDMFReader(registrationName="solid", FileNames=[str(HERE / {file!r})])
moved = WarpByVector(registrationName="deformed", Input=solid)
moved.Vectors = ["POINTS", "u"]
moved.ScaleFactor = 1.0  # its true displacement
body = Show(moved, view)
body.SetRepresentationType("Surface With Edges")
ColorBy(body, None)
body.DiffuseColor = [0.72, 0.75, 0.80]
body.Opacity = {opacity}
"""
TAIL = """
scene = GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
scene.GoToLast()
{rescale}view.Background = [1.0, 1.0, 1.0]
view.UseColorPaletteForBackground = 0
# from the front, z upward
view.CameraPosition, view.CameraFocalPoint = [0.5, -1.0, 0.35], [0.0, 0.0, 0.0]
view.CameraViewUp = [0.0, 0.0, 1.0]
ResetCamera(view)
if len(sys.argv) > 1 and sys.argv[-1].endswith(".png"):
    SaveScreenshot(sys.argv[-1], view)
"""
RESCALE = "shown.RescaleTransferFunctionToDataRange(False, True)\n"


def described(source: Path) -> tuple[Path, bool]:
    """Return the XDMF file of a field file, and whether it holds a solid."""
    fields = source.with_suffix(".h5")
    xdmf = source.with_suffix(".xdmf")
    with FieldFile(fields) as file:
        solid = file.mesh is not None
        step = file.read(0)
        if not solid and not {"quat", "axes", "v"} <= step.grains.keys():
            raise FaultError("E651", f"{fields} holds no shapes and velocities of grains")
        if solid and "u" not in step.solid:
            raise FaultError("E651", f"{fields} holds no displacements of a solid")
    if not xdmf.exists():
        hint = f"keep {xdmf.name} beside {fields.name}: the run writes both"
        raise FaultError("E650", f"no such file: {xdmf}", hint)
    return xdmf.resolve(), solid


def write_scene(sources: list[Path], target: Path) -> None:
    """Write the script of a scene of field files: grains, solids, or both."""
    if target.suffix != ".py":
        raise FaultError("E555", f"'{target}' is no name ending in .py")
    found = [described(source) for source in sources]
    folder = target.resolve().parent
    title = "Grains and solids of " + ", ".join(source.name for source in sources)
    text = HEAD.format(title=title, name=target.name, folder=str(folder))
    opacity = 0.35 if any(not solid for _, solid in found) else 1.0
    for xdmf, solid in found:
        inside = xdmf.is_relative_to(folder)
        file = str(xdmf.relative_to(folder) if inside else xdmf)
        text += (SOLID if solid else GRAINS).format(file=file, opacity=opacity)
    rescale = RESCALE if any(not solid for _, solid in found) else ""
    write_text_file(target, text + TAIL.format(rescale=rescale))
