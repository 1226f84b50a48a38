"""Controllers of the user's own: where `module:object` is found, and how one begins a run."""

from __future__ import annotations

import inspect
import sys
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

from grasp_ros.physics.control import Law
from grasp_ros.physics.errors import Refused, described
from grasp_ros.physics.observation import CALLABLE, observables_of

FAULTS = (Exception, SystemExit, GeneratorExit)  # of a user's code; a KeyboardInterrupt is a Ctrl-C


def find_law(given: str, what: str) -> Law | type:
    """The object that `module:object` names; `what` begins a refusal.

    The module is one of the working directory, or one that is installed, which goes first.
    """
    if not all(given.partition(":")) or given.startswith("."):
        raise Refused(f"{what} is not allowed; allowed: module:object")
    module, _, name = given.partition(":")
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)  # last: a file of the user's does not take the place of a library
    try:
        holder: Any = import_module(module)
    except (ImportError, SyntaxError) as error:
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise Refused(f"{what}: no module {error.name}; allowed: one of the current directory, or one that is"
                          " installed") from None
        raise Refused(f"{what}: {module} cannot be imported: {error}") from None
    except FAULTS as error:
        raise Refused(f"{what}: {module} cannot be imported: {described(error)}") from error
    try:
        law: Any = reduce(getattr, name.split("."), holder)
    except AttributeError:
        where = getattr(holder, "__file__", "built into Python")
        raise Refused(f"{what}: {module} has no {name} ({where}); allowed: a callable of it") from None
    if not callable(law):
        raise Refused(f"{what}: {law!r} cannot be called; allowed: {CALLABLE}")
    return law  # type: ignore[no-any-return]


def begin(law: Law | type, what: str) -> Law:
    """What answers in a run that begins: a new object of a class; any other object itself, after its `reset`, if any.

    What cannot be called as `physics.observation.observables_of` says is refused; `what` begins the refusal.
    """
    begun: Any = law
    if isinstance(law, type):
        try:
            inspect.signature(law).bind()
        except (TypeError, ValueError) as error:
            raise Refused(f"{what}: {law.__name__}: {error}; allowed: a class that is called without arguments, or an"
                          " object") from None
    try:
        if isinstance(law, type):
            begun = law()
        elif hasattr(law, "reset"):
            law.reset()
    except FAULTS as error:
        raise Refused(f"{what}: {law!r} cannot be initialised: {described(error)}") from error
    if not callable(begun):
        raise Refused(f"{what}: {begun!r} is not allowed; allowed: {CALLABLE}")
    try:
        observables_of(begun)
    except TypeError as error:
        raise Refused(f"{what}: {error}; allowed: {CALLABLE}") from None
    return begun  # type: ignore[no-any-return]
