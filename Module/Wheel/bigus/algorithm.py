# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What the pipeline filters have in common: properties, errors and progress as VTK's own classes have them."""

from __future__ import annotations

import functools
import inspect
import os
import weakref
from typing import TYPE_CHECKING, Any, Callable, NamedTuple, Optional, Sequence

import numpy as np
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkTable
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _core
from .documentation import CLASSES
from .names import no_such, snake_case, vtk_case
from .pipeline import set_properties
from .vtkdata import add_arrays

NO_ERROR, USER_ERROR = 0, 40000  # of vtkErrorCode


class Clamped(NamedTuple):
    """The default of a number that stays between two others, as by vtkSetClampMacro; whole ones stay whole."""

    value: float
    low: float
    high: float


class Choice(NamedTuple):
    """The default of a property that is one of these, counted from 0; each name is a constant of the class, too."""

    value: int
    names: tuple[str, ...]


class Open(NamedTuple):
    """A property without a value until it is set; it then shows this one."""

    value: tuple


def _converted(name: str, default: Any, values: tuple) -> Any:
    """What Set<Name> was called with, as a value of the property's kind."""
    value = values[0] if len(values) == 1 else values
    if isinstance(default, Choice):
        default = Clamped(default.value, 0, len(default.names) - 1)
    if isinstance(default, Clamped):
        return min(max(type(default.value)(value), default.low), default.high)
    if isinstance(default, Open):
        default = default.value
    if isinstance(default, tuple):
        value = tuple(type(default[0])(v) for v in value)
        if len(value) != len(default):
            raise TypeError(f"{name} is {len(default)} numbers, not {len(value)}")
        return value
    if isinstance(default, str):
        return "" if value is None else os.fspath(value)
    return value if default is None else type(default)(value)


def _methods(name: str, default: Any) -> dict[str, Callable]:
    def put(self: Any, value: Any) -> None:
        if self._values[name] != value:
            self._values[name] = value
            self.Modified()

    def getter(self: Any) -> Any:
        value = self._values[name]
        if isinstance(default, Open) and value is None:
            return default.value
        return int(value) if isinstance(default, bool) else value

    methods = {"Set" + name: lambda self, *values: put(self, _converted(name, default, values)), "Get" + name: getter}
    if isinstance(default, Open):
        methods[f"Set{name}ToDefault"] = lambda self: put(self, None)
    if isinstance(default, bool):
        methods[name + "On"] = lambda self: put(self, True)
        methods[name + "Off"] = lambda self: put(self, False)
    if isinstance(default, Choice):
        methods[f"Get{name}AsString"] = lambda self: default.names[self._values[name]]
        for number, choice in enumerate(default.names):
            methods[f"Set{name}To{choice}"] = lambda self, number=number: put(self, number)
    return methods


def _adds(*methods: dict[str, Callable]) -> Callable[[type], type]:
    def decorate(cls: type) -> type:
        for some in methods:
            add_methods(cls, some)
        return cls

    return decorate


def properties(**defaults: Any) -> Callable[[type], type]:
    """Adds Set<Name> and Get<Name> for every name, and what its kind of default has besides, such as <Name>On."""
    kinds = (Clamped, Choice)
    plain = {name: None if isinstance(default, Open) else default.value if isinstance(default, kinds) else default
             for name, default in defaults.items()}  # fmt: skip

    def decorate(cls: type) -> type:
        cls.defaults = {**getattr(cls, "defaults", {}), **plain}
        return _adds(*(_methods(name, default) for name, default in defaults.items()))(cls)

    return decorate


def parts(*names: str) -> Callable[[type], type]:
    """Adds Set<Name> and Get<Name> of objects, None at first, whose changes are followed."""
    return _adds(*({"Set" + name: lambda self, part, name=name: self._set_part(name, part),
                    "Get" + name: lambda self, name=name: self._parts.get(name)} for name in names))  # fmt: skip


def ports(**names: int) -> Callable[[type], type]:
    """Adds Get<Name> and Get<Name>Port of outputs by their numbers."""
    return _adds(*({"Get" + name: lambda self, number=number: self.GetOutputDataObject(number),
                    f"Get{name}Port": lambda self, number=number: self.GetOutputPort(number)} for name, number in names.items()))


def input_ports(**names: int) -> Callable[[type], type]:
    """Adds Set<Name>Connection and Set<Name>Data of inputs by their numbers."""
    return _adds(*({f"Set{name}Connection": lambda self, port, number=number: self.SetInputConnection(number, port),
                    f"Set{name}Data": lambda self, data, number=number: self.SetInputDataObject(number, data)}
                   for name, number in names.items()))  # fmt: skip


def getters(source: str, **names: tuple[str, Any]) -> Callable[[type], type]:
    """Adds Get<Name> of what the dict in attribute `source` has for a key, or of a default."""

    def of(key: str, default: Any) -> Callable:
        def get(self: Any) -> Any:
            return getattr(self, source).get(key, default)

        return fills(get) if isinstance(default, tuple) else get

    return _adds({"Get" + name: of(*found) for name, found in names.items()})


def add_methods(cls: type, methods: dict[str, Callable]) -> None:
    for name, function in methods.items():
        if name not in cls.__dict__:
            function.__name__, function.__qualname__ = name, f"{cls.__name__}.{name}"
            setattr(cls, name, function)
    _offer(cls, methods)


def _said(cls: type, name: str) -> Optional[str]:
    """What the C++ class says of a property or method, by its name without Set or Get."""
    return next((CLASSES[base.__name__][name] for base in cls.__mro__ if name in CLASSES.get(base.__name__, ())), None)


def _takes(method: Any, *arguments: Any) -> bool:
    try:
        inspect.signature(method).bind(*arguments)
    except (TypeError, ValueError):  # too few or too many, or a method of VTK's without a signature
        return False
    return True


def _offer(cls: type, methods: Any) -> None:
    """Says what methods are for, and adds properties in snake_case, as VTK's own classes have them from 9.4 on."""
    for method in list(methods):
        name = method[3:] if method[:3] in ("Set", "Get") else method
        function = cls.__dict__[method]
        if not function.__doc__:
            ending = next((e for e in ("On", "Off", "ToDefault", "AsString") if name.endswith(e)), "")
            function.__doc__ = _said(cls, name) or _said(cls, name[: len(name) - len(ending)])
        getter, setter = (getattr(cls, kind + name, None) for kind in ("Get", "Set"))
        reads, writes = _takes(getter, None), _takes(setter, None, None)
        if name != method and (reads or writes):
            get = (lambda self, name=name: getattr(self, "Get" + name)()) if reads else None
            put = (lambda self, value, name=name: getattr(self, "Set" + name)(value)) if writes else None
            setattr(cls, snake_case(name), property(get, put, None, _said(cls, name)))


def fills(method: Callable) -> Callable:
    """A getter of several numbers: it gives them, or fills a list with them, as VTK's do."""

    def get(self: Any, numbers: Optional[list] = None) -> Optional[tuple]:
        found = tuple(method(self))
        if numbers is None:
            return found
        numbers[:] = found
        return None

    get.__doc__ = method.__doc__
    return get


def guarded(method: Callable) -> Callable:
    """What the method raises is reported as VTK's algorithms report errors, and then it gives 0."""

    @functools.wraps(method)
    def run(self: Any, *arguments: Any) -> Any:
        self._error_code = NO_ERROR
        try:
            return method(self, *arguments)
        except Exception as error:
            self._report("ErrorEvent", str(error))
            self._error_code = USER_ERROR
            return 0

    return run


class Algorithm(VTKPythonAlgorithmBase):
    """Values of properties, and errors as VTK's own algorithms report them.

    A class of its own says what its ports take and give, in `_begin()` what it begins with, and in `_fill(data, outputs)`
    what comes out. `data` has a list of objects for each input port.
    """

    defaults: dict[str, Any] = {}
    _inputs: Sequence[str] = ()
    _outputs: Sequence[str] = ()
    _optional: Sequence[int] = ()  # ports of inputs
    _repeatable: Sequence[int] = ()
    InputType = OutputType = ""  # of VTK's class, which sets them

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        _offer(cls, [name for name, value in vars(cls).items() if inspect.isfunction(value) and name[0].isupper()])

    def __new__(cls, **properties: Any) -> Any:
        return super().__new__(cls)

    def __init__(self, **properties: Any):
        """Properties are spelt elevation_sigma or ElevationSigma."""
        self._values = dict(self.defaults)
        self._error_code = NO_ERROR
        self._parts: dict[str, Any] = {}  # objects that the algorithm follows
        self._tags: dict[str, int] = {}
        self._kept: dict[str, tuple] = {}
        VTKPythonAlgorithmBase.__init__(self, nInputPorts=len(self._inputs), nOutputPorts=len(self._outputs))
        self._begin()
        set_properties(self, properties)

    def _begin(self) -> None:
        pass

    def __setattr__(self, name: str, value: Any) -> None:
        kind = type(self)
        if not name.startswith("_") and not hasattr(kind, name):
            known = [one for one in dir(kind) if isinstance(inspect.getattr_static(kind, one), property)]
            raise AttributeError(no_such(kind.__name__, "property", name, known))
        super().__setattr__(name, value)

    if TYPE_CHECKING:  # the methods that decorators add

        def __getattr__(self, name: str) -> Any: ...

    def GetClassName(self) -> str:
        return type(self).__name__

    def GetErrorCode(self) -> int:
        return self._error_code

    def FillInputPortInformation(self, port: int, info: Any) -> int:
        info.Set(vtkAlgorithm.INPUT_REQUIRED_DATA_TYPE(), self._inputs[port])
        info.Set(vtkAlgorithm.INPUT_IS_OPTIONAL(), int(port in self._optional))
        info.Set(vtkAlgorithm.INPUT_IS_REPEATABLE(), int(port in self._repeatable))
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

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Asks for whole images."""
        key = vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT()
        for connections in inputs:
            for info in infos_of(connections):
                if info.Has(key):
                    info.Set(vtkStreamingDemandDrivenPipeline.UPDATE_EXTENT(), extent_of(info, key), 6)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        filled = [vtkDataObject.GetData(info) for info in infos_of(outputs)]
        for output in filled:
            output.Initialize()
        done = self._fill_all([[vtkDataObject.GetData(info) for info in infos_of(port)] for port in inputs], filled)
        if not done:
            for output in filled:
                output.Initialize()
        return done

    @guarded
    def _fill_all(self, data: list, outputs: list) -> int:
        self._fill(data, outputs)
        return 1

    def _while(self, name: str, key: Any, make: Callable[[], Any]) -> Any:
        """What make() gave, while the key stays as it is."""
        if self._kept.get(name, (None,))[0] != key:
            self._kept.pop(name, None)
            self._kept[name] = (key, make())
        return self._kept[name][1]

    def _update_input(self, port: int = 0) -> Any:
        """Brings an input up to date before data are asked for; it."""
        if self.GetNumberOfInputConnections(port):
            connection = self.GetInputConnection(port, 0)
            connection.GetProducer().Update(connection.GetIndex())
        return self.GetInputDataObject(port, 0)

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

    def _go_on(self, fraction: float, text: Optional[str] = None) -> bool:
        """Reports progress; False when the algorithm was asked to stop."""
        if text is not None:
            self.SetProgressText(text)
        self.UpdateProgress(fraction)
        return not self.GetAbortExecute()


def infos_of(vector: Any) -> list:
    return [vector.GetInformationObject(k) for k in range(vector.GetNumberOfInformationObjects())]


def extent_of(info: Any, key: Any) -> tuple:
    return tuple(info.Get(key, k) for k in range(6))


def tell_image(info: Any, extent: Sequence[int], scalar_type: Optional[int] = None,
               spacing: Sequence[float] = (1.0,) * 3, origin: Sequence[float] = (0.0,) * 3) -> None:
    """Says where the pixels of an image that is not made yet will lie, and of which type they are."""
    info.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), extent, 6)
    info.Set(vtkDataObject.SPACING(), spacing, 3)
    info.Set(vtkDataObject.ORIGIN(), origin, 3)
    if scalar_type is not None:
        vtkDataObject.SetPointDataActiveScalarInfo(info, scalar_type, 1)


def matrix_of(matrix: Optional[vtkMatrix4x4]) -> np.ndarray:
    if matrix is None:
        return np.eye(4)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def transform_matrix(transform: Any, name: str, what: str) -> Optional[np.ndarray]:
    """The matrix of a linear transform, of None none; Error for one that may bend `what`."""
    if transform is None:
        return None
    if not transform.IsA("vtkHomogeneousTransform"):
        _core.refuse_transform(name, transform.GetClassName(), what)
    transform.Update()
    return matrix_of(transform.GetMatrix())


def table_of(columns: dict[str, Any]) -> vtkTable:
    """Columns of numbers (arrays) and of texts (lists)."""
    table = vtkTable()
    add_arrays(table.GetRowData(), columns)
    return table


def table_of_rows(rows: Sequence[dict[str, Any]], **kinds: type) -> vtkTable:
    """Rows of such values by their names in snake case, with VTK's names of columns."""
    types = {int: np.int32, bool: np.int32, float: np.float64}
    columns = {name: [row[name] for row in rows] for name in kinds}
    return table_of({vtk_case(name): values if kinds[name] is str else np.array(values, types[kinds[name]])
                     for name, values in columns.items()})  # fmt: skip
