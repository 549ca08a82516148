# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What the pipeline filters have in common: properties, errors and progress as VTK's own classes have them."""

from __future__ import annotations

import os
import weakref
from typing import Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkTable
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from .vtkdata import texts_to_vtk, to_vtk

NO_ERROR, USER_ERROR = 0, 40000  # of vtkErrorCode


class Clamped(NamedTuple):
    """The default of a whole number that stays between two others, as by vtkSetClampMacro."""

    value: int
    low: int
    high: int


def properties(**defaults: Any) -> Callable[[type], type]:
    """Adds Set<Name> and Get<Name> for every name, and <Name>On and <Name>Off for switches; None is an open default."""

    def add(cls: type, name: str, default: Any) -> None:
        def setter(self: Any, *values: Any) -> None:
            value = values[0] if len(values) == 1 else values
            if isinstance(default, Clamped):
                value = min(max(int(value), default.low), default.high)
            elif isinstance(default, tuple):
                value = tuple(type(default[0])(v) for v in value)
                if len(value) != len(default):
                    raise TypeError(f"{name} is {len(default)} numbers, not {len(value)}")
            elif isinstance(default, bool):
                value = bool(value)
            elif isinstance(default, str):
                value = "" if value is None else os.fspath(value)
            elif default is not None:
                value = type(default)(value)
            if self._values[name] != value:
                self._values[name] = value
                self.Modified()

        def getter(self: Any) -> Any:
            value = self._values[name]
            return int(value) if isinstance(default, bool) else value

        methods = {"Set" + name: setter, "Get" + name: getter}
        if isinstance(default, bool):
            methods[name + "On"] = lambda self: setter(self, True)
            methods[name + "Off"] = lambda self: setter(self, False)
        for method, function in methods.items():
            if method not in cls.__dict__:
                setattr(cls, method, function)

    def decorate(cls: type) -> type:
        plain = {name: default.value if isinstance(default, Clamped) else default for name, default in defaults.items()}
        cls.defaults = {**getattr(cls, "defaults", {}), **plain}
        for name, default in defaults.items():
            add(cls, name, default)
        return cls

    return decorate


def geometry(name: str, usual: tuple) -> dict[str, Callable]:
    """The methods of a property that has a default of its own: Set, Get and Set<Name>ToDefault."""

    def setter(self: Any, *values: Any) -> None:
        value = tuple(type(usual[0])(v) for v in (values[0] if len(values) == 1 else values))
        if len(value) != len(usual):
            raise TypeError(f"{name} is {len(usual)} numbers, not {len(value)}")
        if self._values[name] != value:
            self._values[name] = value
            self.Modified()

    def to_default(self: Any) -> None:
        if self._values[name] is not None:
            self._values[name] = None
            self.Modified()

    def getter(self: Any) -> tuple:
        return usual if self._values[name] is None else self._values[name]

    return {"Set" + name: setter, "Get" + name: getter, f"Set{name}ToDefault": to_default}


class Algorithm(VTKPythonAlgorithmBase):
    """What all have in common: values of properties, and errors as VTK's own algorithms report them."""

    defaults: dict[str, Any] = {}

    def __init__(self, inputs: Sequence[str], outputs: Sequence[str]):
        self._values = dict(self.defaults)
        self._inputs, self._outputs = inputs, outputs
        self._error_code = NO_ERROR
        self._parts: dict[str, Any] = {}  # objects that the algorithm follows
        self._tags: dict[str, int] = {}
        VTKPythonAlgorithmBase.__init__(self, nInputPorts=len(inputs), nOutputPorts=len(outputs))

    def GetClassName(self) -> str:
        return type(self).__name__

    def GetErrorCode(self) -> int:
        return self._error_code

    def FillInputPortInformation(self, port: int, info: Any) -> int:
        info.Set(vtkAlgorithm.INPUT_REQUIRED_DATA_TYPE(), self._inputs[port])
        return 1

    def FillOutputPortInformation(self, port: int, info: Any) -> int:
        info.Set(vtkDataObject.DATA_TYPE_NAME(), self._outputs[port])
        return 1

    def SetInputData(self, *arguments: Any) -> None:
        """(data) or (port, data)."""
        self.SetInputDataObject(*arguments)

    def GetOutput(self, port: int = 0) -> Any:
        return self.GetOutputDataObject(port)

    def GetInput(self) -> Any:
        return self.GetInputDataObject(0, 0)

    def _set_part(self, name: str, part: Any) -> None:
        """Keeps an object by reference: a change to it is seen at the next update."""
        old = self._parts.get(name)
        if old is part:
            return
        if old is not None:
            old.RemoveObserver(self._tags.pop(name))
        self._parts[name] = part
        if part is not None:
            me = weakref.ref(self)

            def changed(caller: Any, event: str) -> None:
                if me() is not None:
                    me().Modified()

            self._tags[name] = part.AddObserver("ModifiedEvent", changed)
        self.Modified()

    def _report(self, event: str, text: str) -> None:
        if self.HasObserver(event):
            self.InvokeEvent(event, text)
        elif event == "ErrorEvent":
            vtkOutputWindow.GetInstance().DisplayErrorText(f"ERROR: {self.GetClassName()}: {text}\n")
        else:
            vtkOutputWindow.GetInstance().DisplayWarningText(f"Warning: {self.GetClassName()}: {text}\n")

    def _fail(self, error: BaseException) -> int:
        self._report("ErrorEvent", str(error))
        self._error_code = USER_ERROR
        return 0

    def _go_on(self, fraction: float, text: Optional[str] = None) -> bool:
        """Reports progress; False when the algorithm was asked to stop."""
        if text is not None:
            self.SetProgressText(text)
        self.UpdateProgress(fraction)
        return not self.GetAbortExecute()


def extent_of(info: Any, key: Any) -> tuple:
    return tuple(info.Get(key, k) for k in range(6))


def want_all(inputs: Any) -> None:
    """Asks the connections of a port for whole images."""
    pipeline = vtkStreamingDemandDrivenPipeline
    for k in range(inputs.GetNumberOfInformationObjects()):
        info = inputs.GetInformationObject(k)
        if info.Has(pipeline.WHOLE_EXTENT()):
            info.Set(pipeline.UPDATE_EXTENT(), extent_of(info, pipeline.WHOLE_EXTENT()), 6)


def matrix_of(matrix: Optional[vtkMatrix4x4]) -> np.ndarray:
    if matrix is None:
        return np.eye(4)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def table_of(columns: dict[str, Any]) -> vtkTable:
    """Columns of numbers (arrays) and of texts (lists)."""
    table = vtkTable()
    for name, values in columns.items():
        if isinstance(values, np.ndarray):
            table.AddColumn(to_vtk(values, name))
            continue
        table.AddColumn(texts_to_vtk(values, name))
    return table
