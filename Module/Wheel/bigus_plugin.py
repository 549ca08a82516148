# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""BIGUS in a ParaView for which the compiled plugin was not built: proxies over the Python package without VTK.

ParaView's own Python must find the package `bigus` of Module/Wheel, built for its version, on PYTHONPATH. This file is
loaded by Tools > Manage Plugins > Load New from the package, where bigus.xml lies beside it. That is the compiled plugin's
and has names, properties and their documentation; load one of the two.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from typing import Any, Optional

import bigus
import numpy as np
from bigus import _core
from bigus.algorithm import Algorithm, Clamped, extent_of, guarded, properties
from bigus.settings import SLICER
from bigus.vtkdata import axes_across, field_of_polydata, place_image, plane_on, shadow, share_label_names
from bigus.vtkdata import shifted_to_first_pixel, sweep_of_image, to_vtk
from paraview.modules.vtkRemotingServerManager import vtkSMSettings
from paraview.util.vtkAlgorithm import smproperty, smproxy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkDataSetAttributes
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

paraview_plugin_name = "BIGUS"
paraview_plugin_version = bigus.__version__

LARGEST_SIDE = 16384  # pixels, as in the C++ class


@properties(Origin=(0.0, 0.0, 0.0), Normal=(0.0, 0.0, 1.0), Down=(0.0, 1.0, 0.0), Frame=-1, Size=(512, 512), PixelSize=0.0,
            OutputMode=0, HideUnseen=True, CoverageThreshold=0.1, StandardError=False, Labels=False, LabelValue=Clamped(1, 1, 255),
            **SLICER)
class vtkBigusFieldSlice(Algorithm):
    """A slice of a field as one image at its place; the C++ class of this name tells what each property means."""

    _inputs, _outputs, _optional = ("vtkPolyData", "vtkImageData"), ("vtkImageData",), (1,)

    @guarded
    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        width, height = self._values["Size"]
        if not 1 <= min(width, height) <= max(width, height) <= LARGEST_SIDE:
            raise bigus.Error(f"Size is {width} x {height}; give 1 to {LARGEST_SIDE} columns and rows.")
        if self._values["Frame"] >= 0:
            sweep = inputs[1].GetInformationObject(0)
            if sweep is None:
                raise bigus.Error(f"Frame is {self._values['Frame']} but there is no sweep; connect the sweep, or set "
                                  "Frame to -1 to use the plane.")
            first_i, last_i, first_j, last_j = extent_of(sweep, vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())[:4]
            width, height = last_i - first_i + 1, last_j - first_j + 1
        info = outputs.GetInformationObject(0)
        info.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), (0, width - 1, 0, height - 1, 0, 0), 6)
        return 1

    def _at_plane(self, polydata: Any) -> np.ndarray:
        """From pixel (i, j, 0, 1) to mm."""
        pixel, size, origin = self._values["PixelSize"], np.array(self._values["Size"]), np.array(self._values["Origin"])
        axes = axes_across(self._values["Normal"], self._values["Down"])
        if axes is None:
            raise bigus.Error(f"Normal is {self._values['Normal']}; give a vector that is finite and not 0.")
        if not 0 <= pixel < np.inf:
            raise bigus.Error(f"PixelSize is {pixel} mm; give 0 (automatic) or more.")
        centre = np.zeros(2)
        if pixel == 0:
            low, high = shadow(polydata.GetBounds(), axes, origin) if polydata.GetNumberOfPoints() else (centre, centre)
            centre = 0.5 * (low + high)
            pixel = ((high - low) / np.maximum(1, size - 1)).max()
        return plane_on(axes, origin, centre, size, pixel if pixel > 0 else 1.0)  # 1: of a field of one point, or none

    def _at_frame(self, image: Any) -> np.ndarray:
        """From pixel (i, j, 0, 1) to mm."""
        frame, poses = self._values["Frame"], image.GetFieldData().GetArray("ImageToReference")
        number = poses.GetNumberOfTuples() if poses and poses.GetNumberOfComponents() == 16 else 0
        if frame >= number:
            raise bigus.Error(f"Frame is {frame} and the sweep has {number} poses in its field data ImageToReference [16]; "
                              "give a frame that is there, counted from 0.")
        return shifted_to_first_pixel(np.array(poses.GetTuple(frame)).reshape(4, 4), image.GetExtent())

    def _fill(self, data: list, outputs: list) -> None:
        output, polydata, recorded = outputs[0], data[0][0], data[1][0] if data[1] else None
        frame, scattering = self._values["Frame"], self._values["OutputMode"] == 1
        matrix = self._at_frame(recorded) if frame >= 0 else self._at_plane(polydata)
        width, height = recorded.GetDimensions()[:2] if frame >= 0 else self._values["Size"]
        engine, *others = (self._values[name] for name in SLICER)
        settings = (engine or "auto", *others)
        label = self._values["LabelValue"] if self._values["OutputMode"] == 2 else None
        time = polydata.GetMTime()
        field = self._while("field", time, lambda: field_of_polydata(polydata))
        slicer = self._while("slicer", (time, settings, label), lambda: _core.Renderer(field, *settings, True, label))
        image, coverage = slicer.render(matrix[None], width, height, scattering, True)

        output.SetExtent(0, width - 1, 0, height - 1, 0, 0)
        place_image(output, matrix)
        arrays = output.GetPointData()
        arrays.SetScalars(to_vtk(image.ravel(), ("Intensity", "Scattering", "LabelShare")[self._values["OutputMode"]]))
        arrays.AddArray(to_vtk(coverage.ravel(), "Coverage"))
        if recorded is not None:
            sweep = self._while("sweep", recorded.GetMTime(), lambda: sweep_of_image(recorded)[0])
            distance = bigus.distance_to_frames(sweep, matrix, (width, height))
            arrays.AddArray(to_vtk(distance.ravel(), "Distance"))
        if self._values["StandardError"]:
            arrays.AddArray(to_vtk(bigus.standard_error(field, matrix, (width, height)).ravel(), "StandardError"))
        if self._values["Labels"]:
            labelled = self._while("labels", (time, settings[:2]), lambda: _core.LabelRenderer(field, *settings[:2]))
            arrays.AddArray(to_vtk(labelled.render(matrix, width, height).ravel(), "Labels"))
            share_label_names(polydata, output)
        if frame >= 0:
            count = width * height
            pixels = vtk_to_numpy(recorded.GetPointData().GetScalars())[frame * count:(frame + 1) * count]
            arrays.AddArray(to_vtk(pixels, "Recorded"))
        if self._values["HideUnseen"]:
            unseen = coverage.ravel() <= max(0.0, self._values["CoverageThreshold"]) * slicer.mean_coverage
            arrays.AddArray(to_vtk((unseen * vtkDataSetAttributes.HIDDENPOINT).astype(np.uint8),
                                   vtkDataSetAttributes.GhostArrayName()))


def _expose() -> None:
    """A class of this module for every proxy of bigus.xml, with its XML as ParaView's decorators keep it."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "bigus.xml")
    for group in ElementTree.parse(path).getroot().iter("ProxyGroup"):
        for proxy in group.iter("SourceProxy"):
            name = proxy.get("class")
            own = globals().get(name) or getattr(bigus, name, None)
            if own is None:
                continue  # of the compiled plugin alone
            kind = type(name, (own,), {"__module__": __name__, "__doc__": own.__doc__})
            children = "".join(ElementTree.tostring(child, encoding="unicode") for child in proxy)
            declare = smproxy.source(name=proxy.get("name"), label=proxy.get("label"), group=group.get("name"),
                                     support_reload=False)
            declare(smproperty.xml(children)(kind))
            globals()[name] = kind


_expose()
# Ultrasound is grey where the user's settings name no other preset, as in the compiled plugin.
vtkSMSettings.GetInstance().AddCollectionFromString(
    '{"standard_presets": {"Intensity": "Grayscale", "Recorded": "Grayscale"}}', 0.5)
