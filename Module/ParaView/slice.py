# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""From a sweep to a slice in pvpython, where the plugin is loaded: pvpython slice.py [IMAGE.vti]"""
import sys

from paraview.simple import *

sweep = BIGUSPhantom(NumberOfFrames=33, FrameSize=[96, 72], PixelSize=0.4)
field = BIGUSTrainer(Input=sweep, Automatic=0, Iterations=200)
field.UpdatePipeline()  # the slice begins in the middle of the field, which must be known
image = BIGUSFieldSlice(Input=field, Sweep=sweep, Normal=[1, 0, 0])
SaveData(sys.argv[1] if len(sys.argv) > 1 else "slice.vti", proxy=image)
print("intensities from %.3f to %.3f" % image.PointData["Intensity"].GetRange())
