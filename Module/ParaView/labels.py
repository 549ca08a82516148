# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Labels in ParaView: a slice with regions in the labels' colours, their names as the legend, and one label's surface.

    pvpython labels.py BIGUS.so FIELD.vtp VALUE PICTURE.png     FIELD has labels, VALUE is that of the surface's
"""
import sys

from paraview import servermanager
from paraview.simple import *

plugin, path, value, picture = sys.argv[1:5]
LoadPlugin(plugin, remote=False, ns=globals())
field = BIGUSFieldReader(FileName=path)
field.UpdatePipeline()  # the slice begins in the middle of the field, which must be known
view = CreateRenderView(ViewSize=[800, 600])
view.UseColorPaletteForBackground, view.Background = 0, [0, 0, 0]

image = BIGUSFieldSlice(Input=field, Normal=[0.5, 0.2, 0.85], Labels=1)
grey = Show(image, view)
grey.Ambient, grey.Diffuse = 1, 0
grey.SetScalarBarVisibility(view, False)

# What has a label, in front of the slice.
regions = Threshold(Input=image, Scalars=["POINTS", "Labels"], LowerThreshold=1, UpperThreshold=255)
shown = Show(regions, view)
ColorBy(shown, ("POINTS", "Labels"))
shown.Opacity, shown.Ambient, shown.Diffuse = 0.4, 1, 0
shown.Position = [-0.05 * n for n in image.Normal]  # mm, towards the camera
kept = servermanager.Fetch(image).GetFieldData()
names, values, colours = (kept.GetAbstractArray("Label" + kind) for kind in ("Names", "Values", "Colors"))
table = GetColorTransferFunction("Labels")
table.InterpretValuesAsCategories = 1
table.Annotations = [text for k in range(values.GetNumberOfTuples()) for text in (str(values.GetValue(k)), names.GetValue(k))]
table.IndexedColors = [part for k in range(values.GetNumberOfTuples()) for part in colours.GetTuple(k)]
GetScalarBar(table, view).Title, GetScalarBar(table, view).ComponentTitle = "label", ""
shown.SetScalarBarVisibility(view, True)

share = BIGUSVoxelizer(Input=field, OutputMode="Share of a label", LabelValue=int(value), MaximumDimension=160)
surface = Contour(Input=share, ContourBy=["POINTS", "LabelShare"], Isosurfaces=[0.5])
drawn = Show(surface, view)
ColorBy(drawn, None)
own = [k for k in range(values.GetNumberOfTuples()) if values.GetValue(k) == int(value)]
drawn.DiffuseColor = drawn.AmbientColor = list(colours.GetTuple(own[0]))
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [-0.8, -0.5, -1.6], [0, 0, 0], [0, -1, 0]
ResetCamera(view)
SaveScreenshot(picture, view, ImageResolution=[800, 600])
assert surface.GetDataInformation().GetNumberOfCells() > 100 < regions.GetDataInformation().GetNumberOfCells()
