# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Names of options and properties: HoldOut, as in VTK, or hold_out."""

from __future__ import annotations

import difflib
import inspect
import re
from typing import Any, Callable, Iterable


def snake_case(name: str) -> str:
    """NumberOfFrames as number_of_frames, as VTK spells properties from 9.4 on."""
    return re.sub("(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def vtk_case(name: str) -> str:
    """number_of_frames as NumberOfFrames."""
    return "".join(part.capitalize() for part in name.split("_"))


def _plain(name: str) -> str:
    return name.replace("_", "").replace("-", "").lower()


def no_such(owner: str, noun: str, name: str, known: Iterable[str]) -> str:
    """What to say of a name that there is not, and which was meant, spelt as it was spelt."""
    names = {_plain(one): one for one in known}
    close = difflib.get_close_matches(_plain(name), names, 1)
    meant = names[close[0]] if close else ""
    hint = f"; did you mean {snake_case(meant) if name.islower() else meant}?" if close else ""
    return f"{owner} has no {noun} {name}{hint}"


def by_name(given: dict[str, Any], known: Iterable[str], owner: str, noun: str = "property") -> dict[str, Any]:
    """What is given, by names that are known. TypeError for one that is not, and for one that is given in two spellings."""
    names = {_plain(name): name for name in known}
    spelt: dict[str, str] = {}
    for name in given:
        own = names.get(_plain(name))
        if own is None:
            raise TypeError(no_such(owner, noun, name, names.values()))
        if own in spelt:
            raise TypeError(f"{spelt[own]} and {name} are the same {noun} of {owner}; give one of them")
        spelt[own] = name
    return {own: given[name] for own, name in spelt.items()}


def spell_out(function: Callable, defaults: dict[str, Any]) -> None:
    """Puts options and their defaults into the signature of a function, where help and editors look for them."""
    signature = inspect.signature(function)
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    options = [inspect.Parameter(snake_case(name), inspect.Parameter.KEYWORD_ONLY, default=value)
               for name, value in defaults.items()]  # fmt: skip
    setattr(function, "__signature__", signature.replace(parameters=[*own, *options]))
