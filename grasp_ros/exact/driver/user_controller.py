"""Controllers from outside: the kernels call them as C functions, by their address.

    double command(int64 tick, double time, double x, double v)     s, m, m/s to N

A function that numba has compiled runs at full speed. Any other callable is called through ctypes, which takes the
interpreter's lock for as long as it runs; so is a compiled one that asks for more, see `physics.observation`.
"""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numba
from numba.core.ccallback import CFunc
from numba.core.errors import NumbaError
from numba.core.types import float64, int64
from numba.core.types.misc import Optional
from numba.extending import is_jitted

from grasp_ros.exact.compilation.jit import COMPILED, code_of_call, instruction
from grasp_ros.physics.control import Law, command_of
from grasp_ros.physics.errors import Failed, Refused, described
from grasp_ros.physics.observation import Observation, observables_of

SIGNATURE = float64(int64, float64, float64, float64)
COLOUR, BESIDE = re.compile(r"\x1b\[[0-9;]*m"), ("Failed in", "During")  # of numba's errors
PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_double, ctypes.c_double, ctypes.c_double)


@instruction(lambda _, address, tick, time, x, v: (float64(int64, *SIGNATURE.args), code_of_call))
def call(address: int, tick: int, time: float, x: float, v: float) -> float:
    """The command of the function at an address."""
    return float(PROTOTYPE(int(address))(tick, time, x, v))


@lru_cache(maxsize=64)
def _compiled(law: Any) -> Any:
    """A C function that answers NaN where the law raises, which is not for a kernel to hear about.

    None for a law that may answer None: C would be given a 0.
    """
    inner = numba.njit(law.__wrapped__) if isinstance(law, CFunc) else law
    inner.compile(SIGNATURE.args)
    if isinstance(inner.overloads[SIGNATURE.args].signature.return_type, Optional):
        return None

    def command(tick, time, x, v):  # type: ignore[no-untyped-def]  # numba infers its types
        try:
            return inner(tick, time, x, v)
        except Exception:
            return math.nan

    return numba.cfunc(SIGNATURE)(command)


class UserController:
    """A controller from outside, as the kernels call it.

    Parameters
    ----------
    side : str
        Whose arm it controls; what messages say.
    law : callable
        From tick, time in s, what is measured of the arm, x in m and v in m/s, and what it asks for, to its command
        in N.

    Attributes
    ----------
    asks : tuple of str
        For what, see `physics.observation.OBSERVABLES`.
    observe : callable
        From the tick that is answered to what there is to see; to be set before the kernels run.
    name : str
        Module and name of the law, or of its class.
    address : int
        Of the C function; it lives as long as this object.

    Raises
    ------
    Refused
        If it has been compiled for other arguments.
    """

    def __init__(self, side: str, law: Law) -> None:
        self.asks = observables_of(law)
        self.observe: Callable[[int], Observation]
        numba_law = is_jitted(law) or isinstance(law, CFunc)
        named = getattr(law, "__wrapped__", law) if numba_law else law
        named = named if hasattr(named, "__qualname__") else type(named)
        self.name = f"{named.__module__}:{named.__qualname__}"
        self._who, self._law = f"{side} controller {self.name}", law
        self._error: BaseException | None = None
        try:
            function: Any = _compiled(law) if COMPILED and numba_law and not self.asks else None
        except NumbaError as error:
            lines = [line.strip() for line in COLOUR.sub("", str(error)).splitlines()]
            why = next((line for line in lines if line and not line.startswith(BESIDE)), type(error).__name__)
            raise Refused(f"controllers: {side}: {self.name} cannot be compiled as"
                          f" float(int, float, float, float): {why}") from None
        self._function = function or PROTOTYPE(self._answer)  # which must not go before the address does
        self.address: int = function.address if function else ctypes.cast(self._function, ctypes.c_void_p).value or 0

    def _answer(self, tick: int, time: float, x: float, v: float) -> float:
        """What a callable of Python answers; NaN for what is kept for `failure`."""
        try:
            seen = self.observe(tick).values(self.asks) if self.asks else {}
            return command_of(self._law(tick, time, x, v, **seen), self._who, tick, time)
        except BaseException as error:  # ctypes would print it and go on
            self._error = error
            return math.nan

    def failure(self, tick: int, time: float, x: float, v: float) -> BaseException:
        """Why the answer to a measurement is no command: what the law raised, or a refusal of its answer."""
        error, self._error = self._error, None
        if error is None:  # a compiled law has no memory: it does the same again
            try:
                command_of(self._law(tick, time, x, v), self._who, tick, time)
            except BaseException as again:
                error = again
        if error is None:
            return Failed(f"{self._who}: no finite command at tick {tick}, t = {time!r} s")
        if isinstance(error, Refused) and str(error).startswith(self._who):
            return Failed(str(error))
        if isinstance(error, Refused) or not isinstance(error, (Exception, KeyboardInterrupt)):
            # An exit would end who called us, as if all were done.
            return Failed(f"{self._who}: {described(error)}, tick {tick}, t = {time!r} s")
        error.add_note(f"{self._who}, tick {tick}, t = {time!r} s")
        return error
