"""Parameters of a node: declared from the table, checked, read once."""

from __future__ import annotations

from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from deck_motion_ros.config import configured, Parameter, parameters, unknown_names

T = TypeVar('T')


def configuration(node: Node, kind: type[T]) -> T:
    """
    Declare every parameter of ``kind`` on the node and return the configuration.

    Parameters are read only: a node's set-up does not change under way. Overrides that no
    parameter takes are named in a warning.

    Raises
    ------
    ValueError
        If a value breaks its parameter's rule; the text names the parameter.

    """
    values, overrides = {}, node._parameter_overrides
    for name, rule in parameters(kind).items():
        if rule.default == () and name in overrides and overrides[name].value is None:
            del overrides[name]  # what rcl makes of [] in a parameter file
        if name in overrides:  # checked in our words, and 3 taken where 3.0 is meant
            value = rule.check(overrides[name].value)
            overrides[name] = RosParameter(
                name, value=list(value) if isinstance(value, tuple) else value)
        default = list(rule.default) if isinstance(rule.default, tuple) else rule.default
        declared = node.declare_parameter(
            name, RosParameter.Type.STRING_ARRAY if default == [] else default,
            _descriptor(rule))
        values[name] = declared.value if declared.value is not None else []
    unknown = unknown_names(kind, overrides)
    if unknown:
        node.get_logger().warning(
            f"unknown parameter{'s' * (len(unknown) > 1)} {', '.join(unknown)} ignored")
    return configured(kind, values)


def _descriptor(rule: Parameter) -> ParameterDescriptor:
    limits = rule.span() or '|'.join(rule.choices)
    text = ParameterDescriptor(
        description=f'{rule.meaning} ({limits})' if limits else rule.meaning,
        additional_constraints=', '.join(rule.choices), read_only=True)
    if rule.low is not None and rule.high is not None:
        if isinstance(rule.default, float) and rule.default == rule.default:
            text.floating_point_range = [FloatingPointRange(
                from_value=float(rule.low), to_value=float(rule.high))]
        elif type(rule.default) is int:
            text.integer_range = [IntegerRange(
                from_value=int(rule.low), to_value=int(rule.high), step=1)]
    return text
