# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Running VTK algorithms the Python way: properties by name, errors as exceptions."""

from __future__ import annotations

import re
import threading
import warnings
from typing import Any, Callable, TypeVar

from vtkmodules.vtkCommonCore import VTK_STRING
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm

from .names import by_name

_Algorithm = TypeVar("_Algorithm", bound=vtkAlgorithm)
# What VTK puts before a message: "ERROR: In file.cxx, line 12\nvtkClass (0x55d0): "
_PREFIX = re.compile(r"^(?:ERROR|Warning): In [^\n]*, line \d+\n(?:\w+ \([^)]*\): )?")


def set_properties(algorithm: vtkAlgorithm, properties: dict[str, Any]) -> None:
    """Calls Set<Name>(value) for each property."""
    known = (method[3:] for method in dir(algorithm) if method.startswith("Set"))
    for name, value in by_name(properties, known, algorithm.GetClassName()).items():
        try:
            getattr(algorithm, "Set" + name)(value)
        except TypeError as error:
            raise TypeError(f"{algorithm.GetClassName()}.{name} = {value!r}: {error}") from None


def _run(algorithm: vtkAlgorithm, action: Callable[[], Any]) -> None:
    errors: list[str] = []
    consequences: list[str] = []
    cautions: list[str] = []

    def collect(messages: list[str]) -> Callable[..., None]:
        def on_message(caller: Any, event: str, text: str) -> None:
            messages.append(_PREFIX.sub("", text).strip())

        on_message.CallDataType = VTK_STRING
        return on_message

    # An observed message is not printed. The executive only reports that the algorithm failed, not why.
    executive = algorithm.GetExecutive()
    observed = [
        (algorithm, algorithm.AddObserver("ErrorEvent", collect(errors))),
        (algorithm, algorithm.AddObserver("WarningEvent", collect(cautions))),
        (executive, executive.AddObserver("ErrorEvent", collect(consequences))),
    ]
    try:
        action()
    finally:
        for subject, tag in observed:
            subject.RemoveObserver(tag)
    for text in cautions:
        warnings.warn(text, RuntimeWarning, stacklevel=4)
    messages = errors or consequences
    if messages:
        raise RuntimeError("\n".join(messages))
    if algorithm.GetErrorCode():
        raise RuntimeError(f"{algorithm.GetClassName()} failed with VTK error code {algorithm.GetErrorCode()}")


def update(algorithm: _Algorithm) -> _Algorithm:
    """Updates an algorithm (a writer writes); its VTK errors become RuntimeError, its warnings RuntimeWarning."""
    _run(algorithm, algorithm.Write if hasattr(algorithm, "Write") else algorithm.Update)
    return algorithm


def update_alone(algorithm: _Algorithm) -> _Algorithm:
    """The same for one of our own algorithms whose inputs are data, while other Python threads run.

    Ctrl-C aborts the algorithm; KeyboardInterrupt is raised when it has ended, a fraction of a second later. A second
    Ctrl-C does not wait for that.
    """

    def work() -> None:
        failure: list[BaseException] = []

        def call() -> None:
            from . import _update

            try:
                _update.update(algorithm)
            except BaseException as error:  # belongs to the thread that waits
                failure.append(error)
            done.set()

        # Signals reach Python's main thread only, and only while it is in Python. Thread.join cannot be used, because some
        # versions of Python take a thread for ended when a signal interrupts it.
        done = threading.Event()
        threading.Thread(target=call, name=algorithm.GetClassName(), daemon=True).start()
        interrupt = None
        while not done.is_set():
            try:
                done.wait(0.1)  # seconds; some systems deliver signals only between such waits
            except KeyboardInterrupt as error:
                if interrupt is not None:
                    raise
                interrupt = error
                algorithm.SetAbortExecute(1)
        if interrupt is not None:
            raise interrupt
        if failure:
            raise failure[0]

    _run(algorithm, work)
    return algorithm
