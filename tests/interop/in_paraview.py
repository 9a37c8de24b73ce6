"""In ParaView: opens the coloured mesh, checks it and draws it with its colours. The level set is not for this build:
Debian's has no OpenVDB reader, which is said. Usage: pvbatch in_paraview.py FOLDER"""
import sys

from paraview import servermanager, simple

folder = sys.argv[1]
mesh = simple.PLYReader(FileNames=[f"{folder}/sphere.ply"])
mesh.UpdatePipeline()
data = mesh.GetDataInformation()
assert data.GetNumberOfCells() > 1000
assert all(0.98 < abs(end) < 1.02 for end in data.GetBounds()), data.GetBounds()
found = data.GetPointDataInformation()
arrays = {found.GetArrayInformation(i).GetName() for i in range(found.GetNumberOfArrays())}
assert "RGB" in arrays, arrays
worst = 0.0
polygons = servermanager.Fetch(mesh)
colours = polygons.GetPointData().GetArray("RGB")
for i in range(polygons.GetNumberOfPoints()):
    for coordinate, colour in zip(polygons.GetPoint(i), colours.GetTuple(i)):
        worst = max(worst, abs(colour - 127.5 * (1 + coordinate)))
assert worst < 5, worst

view = simple.CreateRenderView(ViewSize=[320, 240])
view.OrientationAxesVisibility = 0
shown = simple.Show(mesh, view)
simple.ColorBy(shown, ("POINTS", "RGB"))
shown.MapScalars = 0
view.CameraPosition = [3, -3, 2.5]
view.CameraViewUp = [0, 0, 1]
simple.ResetCamera(view)
simple.SaveScreenshot(f"{folder}/interop_paraview.png", view)
reader = "with" if hasattr(simple, "OpenVDBReader") else "without"
print(f"interop: {data.GetNumberOfCells()} triangles, colours within {worst:.1f}/255, {reader} an OpenVDB reader")
