# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Node parameters as a table of rows, which are declared, described and checked in the same way in every node."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from push_predictor.errors import RequestError

Value: TypeAlias = "bool | int | float | str | list[str]"


@dataclass(frozen=True)
class Param:
    """One parameter. low and high limit a number (inclusive); choices limit a text. An empty list is [""].

    true_text: a text that the parser of parameter files takes for `true`, as `y`.
    """

    name: str
    default: Value
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = True
    true_text: str = ""

    @property
    def accepted(self) -> str:
        """In words, which values are accepted."""
        if self.choices:
            return " or ".join(repr(choice) for choice in self.choices)
        kind = {bool: "true or false", int: "an integer", float: "a number", str: "a text"}.get(
            type(self.default), "a list of texts"
        )
        bounds = [f"from {self.low:g}"] if self.low is not None else []
        bounds += [f"up to {self.high:g}"] if self.high is not None else []
        return " ".join([kind, *bounds])

    def allows(self, value: Any) -> bool:
        """Whether a value has the default's type (or is an integer for a float) and is within the limits."""
        if isinstance(self.default, list):
            return _is_texts(value)
        if isinstance(self.default, float):
            return _is_number(value) and math.isfinite(value) and self._within(value)
        if self.true_text and value is True:
            return True
        if type(value) is not type(self.default):
            return False
        if isinstance(self.default, str):
            return not self.choices or value in self.choices
        return isinstance(self.default, bool) or self._within(value)

    def _within(self, value: Any) -> bool:
        return (self.low is None or value >= self.low) and (self.high is None or value <= self.high)


def declare(node: Node, params: Sequence[Param]) -> None:
    """Declare all rows. Check values given at start now, and later changes when they are made.

    What is given and no row takes gets a warning. Raises RequestError that names the parameter, its value and what is
    accepted.
    """
    table = {param.name: param for param in params}
    for name in getattr(node, "_parameter_overrides", {}):  # rclpy has no public name for them
        if name not in table and not node.has_parameter(name) and not name.startswith("qos_overrides."):
            nearest = [f"; the nearest name is {near!r}" for near in get_close_matches(name, table, 1, cutoff=0.5)]
            node.get_logger().warning(f"parameter {name!r} is unknown and ignored{''.join(nearest)}")
    for param in params:
        given = given_value(node, param.name)
        if given is not None and not param.allows(given):
            raise RequestError(param.name, given, param.accepted)
        value = param.default if given is None else native(param, given)
        node.declare_parameter(param.name, value, _descriptor(param), ignore_override=True)
    node.add_on_set_parameters_callback(lambda changed: _checked(table, changed))


def given_value(node: Node, name: str) -> Any:
    """The value from the command line or a file for a parameter not declared yet; None if there is none."""
    value = node.declare_parameter(name, None, ParameterDescriptor(dynamic_typing=True)).value
    node.undeclare_parameter(name)
    return value


def values_of(node: Node, params: Iterable[Param]) -> dict[str, Any]:
    """The present values {name: value}; lists without empty texts."""
    values = {param.name: node.get_parameter(param.name).value for param in params}
    return {name: [text for text in v if text] if isinstance(v, list) else v for name, v in values.items()}


def native(param: Param, value: Any) -> Any:
    """The value in the type of the default: `rate:=10` means `rate:=10.0`."""
    if isinstance(param.default, list):
        return list(value)
    if param.true_text and value is True:
        return param.true_text
    return float(value) if isinstance(param.default, float) else value


def _descriptor(param: Param) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=param.description,
        read_only=param.read_only,
        additional_constraints=param.accepted,
    )
    if isinstance(param.default, float) and (param.low, param.high) != (None, None):
        descriptor.floating_point_range = [FloatingPointRange(**_bounds(param, float, math.inf))]
    elif type(param.default) is int and (param.low, param.high) != (None, None):
        descriptor.integer_range = [IntegerRange(**_bounds(param, int, 2**63 - 1), step=1)]
    return descriptor


def _bounds(param: Param, kind: Any, limit: Any) -> Mapping[str, Any]:
    low = -limit if param.low is None else kind(param.low)
    return {"from_value": low, "to_value": limit if param.high is None else kind(param.high)}


def _checked(table: Mapping[str, Param], changed: Sequence[Parameter]) -> SetParametersResult:
    for parameter in changed:
        row = table.get(parameter.name)
        if row is not None and not row.allows(parameter.value):
            reason = f"{parameter.name}: {parameter.value!r} is not accepted, give {row.accepted}"
            return SetParametersResult(successful=False, reason=reason)
    return SetParametersResult(successful=True)


def _is_texts(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and all(isinstance(text, str) for text in value)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
