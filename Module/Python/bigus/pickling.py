# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Fields and sweeps can be pickled and copied, so that they reach other processes; VTK 9.1 lets neither be done.

Newer VTK does the same in vtkmodules.util.pickle_support; where another package has registered a way, that one stays.
"""

from __future__ import annotations

import copyreg
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkIOXML import (
    vtkXMLImageDataReader,
    vtkXMLImageDataWriter,
    vtkXMLPolyDataReader,
    vtkXMLPolyDataWriter,
)

_FORMATS = {vtkPolyData: (vtkXMLPolyDataReader, vtkXMLPolyDataWriter),
            vtkImageData: (vtkXMLImageDataReader, vtkXMLImageDataWriter)}


def _restore(name: str, text: str) -> Any:
    kind = {kind.__name__: kind for kind in _FORMATS}[name]
    reader = _FORMATS[kind][0]()
    reader.ReadFromInputStringOn()
    reader.SetInputString(text)
    reader.Update()
    data = kind()
    data.ShallowCopy(reader.GetOutput())
    return data


def _reduce(data: Any) -> tuple:
    kind = next(kind for kind in _FORMATS if isinstance(data, kind))
    writer = _FORMATS[kind][1]()
    writer.SetInputDataObject(data)
    writer.WriteToOutputStringOn()
    writer.SetDataModeToBinary()
    writer.SetHeaderTypeToUInt64()
    writer.SetCompressorTypeToNone()
    writer.Write()
    return _restore, (kind.__name__, writer.GetOutputString())


for _kind in _FORMATS:
    copyreg.dispatch_table.setdefault(_kind, _reduce)
