"""Parameters of a node: fixed ones, those of a scene, and what is refused in a sentence."""

from __future__ import annotations

import os
import sys
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.service import Service
from rclpy.subscription import Subscription

from grasp_ros.graph.parameters import FREE, PARAMETERS
from grasp_ros.physics.errors import Refused, allowed
from grasp_ros.physics.given import plain
from grasp_ros.scene import Scene, strict_yaml

FILE = "--params-file"
SIM_TIME = "use_sim_time"  # rclpy lets anybody set it at any time
KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}  # of parameters
OF_ROS = ("ROS_", "RMW_", "RCUTILS_", "FAST")  # how variables begin that rcl and the middleware read
RCLError, UnknownArguments = rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError


class ParameterNode(Node):
    """A node whose parameters are fixed at its start, but for numbers of a scene that may be set while it runs."""

    why_read_only = "set at the start only, with -p or a parameter file"

    def __init__(self, name: str, **options: Any) -> None:
        self._settings = PARAMETERS.get(name, {})
        with refusing():
            super().__init__(name, **options)
        if FILE in sys.argv and not self._parameter_overrides:  # the file may be for others, or the name is wrong
            self.get_logger().info(f"no parameter file has values for {self.get_fully_qualified_name()}")

    def create_service(self, kind: Any, name: str, callback: Callable[..., Any], **options: Any) -> Service:
        """As rclpy's, but that a request which rclpy itself cannot read is answered."""
        return super().create_service(kind, name, self._surviving(callback), **options)

    def create_subscription(
        self, kind: Any, topic: str, callback: Callable[..., Any], *qos: Any, **options: Any
    ) -> Subscription:
        """As rclpy's, but that a message which rclpy itself cannot read, a negative time on /clock, ends no node."""
        return super().create_subscription(kind, topic, self._surviving(callback), *qos, **options)

    def _surviving(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """One of rclpy's own callbacks without its errors, which what anybody sends would let the executor raise."""
        if not type(getattr(callback, "__self__", None)).__module__.startswith("rclpy."):
            return callback

        def survive(*words: Any) -> Any:  # a message, or a request and its response
            try:
                return callback(*words)
            except ValueError as error:
                self.get_logger().warning(f"ignored: {type(words[0]).__name__}: {error}", throttle_duration_sec=5.0)
                if isinstance(words[0], SetParameters.Request):
                    left = len(words[0].parameters) - len(words[1].results)
                    words[1].results += [SetParametersResult(reason=str(error))] * left
                return words[-1]

        return survive

    def read_only(self, name: str) -> Any:
        """Declare one of PARAMETERS, which is set at start only, and return its value."""
        default, text = self._settings[name]
        descriptor = ParameterDescriptor(description=text, read_only=True, dynamic_typing=True)
        value, kind = self.declare(name, default, descriptor), type(default)
        if kind is float and type(value) is int:
            return float(value)
        if type(value) is not kind:
            raise Refused(f"{name}: {value!r} is not allowed; allowed: {KINDS[kind]}")
        return value

    def declare(self, name: str, default: Any, descriptor: ParameterDescriptor) -> Any:
        """The value that the start has given, or the default."""
        with refusing():
            return _plain(self.declare_parameter(name, default, descriptor).value)

    def declare_scene(self, scene: Scene, executable: str) -> dict[str, Any]:
        """Declare the numbers of a scene that belong to an executable; returns what the start has put in their place.

        Those of a scene before are taken back. The types are dynamic so that an integer will do for a floating-point
        number.
        """
        given = {}
        for name in [name for name in self._parameters if "." in name]:  # rclpy does not let go of what is read-only
            del self._parameters[name], self._descriptors[name]
        for effect in scene.effects:
            for parameter in effect.parameters if effect.node == executable else ():
                if parameter.key not in scene.values[effect.section]:
                    continue
                name, value = f"{effect.section}.{parameter.key}", scene.values[effect.section][parameter.key]
                shown = ParameterDescriptor(
                    description=f"{parameter.text}, in {parameter.unit}", dynamic_typing=True,
                    additional_constraints=f"allowed: {parameter.allowed}", read_only=not parameter.live,
                )
                if not parameter.whole and not parameter.several:
                    shown.floating_point_range = [FloatingPointRange(from_value=parameter.low, to_value=parameter.high)]
                found = self.declare(name, list(value) if parameter.several else value, shown)
                if not parameter.accepts(found):
                    raise Refused(f"{name}: {found!r} is not allowed; allowed: {parameter.allowed}")
                if (found := parameter.read(found)) != value:
                    given[name] = found
        self.refuse_unknown(scene)
        return given

    def refuse_unknown(self, scene: Scene | None = None) -> None:
        """Refuse what the start has given and nobody has declared; numbers of a scene too, where there is one."""
        given = [name for name in self._parameter_overrides if scene or "." not in name]
        numbers = [f"{section}.{key}" for section, values in scene.values.items() for key in values] if scene else []
        others = {*chain(*PARAMETERS.values(), numbers)} if FILE in sys.argv else set()  # a file may be for all nodes
        unknown = [name for name in given if not self.has_parameter(name) and name not in others]
        if unknown:  # rclpy itself would not say a word
            name, free = unknown[0], self._parameters.get("free_running")
            missed = free is not None and not free.value and name in FREE
            hint = "allowed: with free_running:=true" if missed else allowed(name, sorted(self._parameters))
            raise Refused(f"{', '.join(unknown)}: no such parameter; {hint}")

    def set_parameters_atomically(self, parameter_list: list[RosParameter]) -> SetParametersResult:
        """Set parameters; what is meant as a floating-point number becomes one, and a refusal says why.

        What is fixed may be set to what it is, so that a node takes its own dump. `ros2 param load` sends 1e-14, which
        has no point, as a text.
        """
        numbers = []
        for parameter in parameter_list:
            name = parameter.name
            if not self.has_parameter(name):
                why = f"no such parameter; {allowed(name, sorted(self._parameters))}"
                return SetParametersResult(successful=False, reason=f"{name}: {why}")
            held, declared = _plain(self.get_parameter(name).value), self.describe_parameter(name)
            value = _plain(parameter.value)
            if declared.dynamic_typing and type(held) in (int, float) and type(value) in (int, str):
                number = _number(value)
                if number is not None:
                    value, parameter = number, RosParameter(name, value=number)
            if declared.read_only or name == SIM_TIME:
                if value == held:
                    continue
                why = self.why_read_only if "." in name else ParameterNode.why_read_only
                return SetParametersResult(successful=False, reason=f"{name}: {why}")
            if not declared.dynamic_typing and type(value) is not type(held):
                why = f"{value!r} is not allowed; allowed: {KINDS[type(held)]}"
                return SetParametersResult(successful=False, reason=f"{name}: {why}")
            numbers.append(parameter)
        return super().set_parameters_atomically(numbers) if numbers else SetParametersResult(successful=True)


def _plain(value: Any) -> Any:
    """Value of a parameter, a list where rclpy has an array."""
    return list(value) if isinstance(value, array) else value


def _number(value: int | str) -> float | None:
    """A number, also one in a text as YAML has it; None for any other text."""
    with suppress(ValueError, OverflowError):
        found = plain(strict_yaml.load(value) if isinstance(value, str) else value)
        return None if found is None else float(found)
    return None


@contextmanager
def refusing() -> Iterator[None]:
    """Refuse what rclpy refuses of parameters and names that are given, and what DDS cannot be, secure for one."""
    try:
        yield
    except (ParameterException, NameValidationException) as error:
        raise Refused(" ".join(str(error).split())) from None
    except RCLError as error:
        raise Refused(words_of(error)) from None


def words_of(error: RuntimeError) -> str:
    """What rcl says, without where in it, and what it was given: words of the command line, and variables."""
    variables = [f"{name}={value}" for name, value in sorted(os.environ.items()) if name.startswith(OF_ROS)]
    why = " ".join(str(error).split()).partition(", at /")[0]
    why = why.replace("Error: error not set", "Error: nothing behind :=")
    why = why.replace("error not set", "it does not say why")
    unknown = "unknown arguments " if isinstance(error, UnknownArguments) else ""
    return f"{unknown}{why}; it was given {' '.join([*sys.argv[1:], *variables])}"
