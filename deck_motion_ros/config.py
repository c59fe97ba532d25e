"""A parameter is a dataclass field with default, unit, meaning and range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, MISSING
import math
from typing import Any, TypeVar

T = TypeVar('T')
Value = bool | int | float | str | tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Parameter:
    """
    What is known of one parameter besides its value.

    Attributes
    ----------
    name : str
        Field and ROS parameter name.
    default : bool, int, float, str or tuple
        Its type is the parameter's type.
    meaning, unit : str
        One sentence; ``''`` where there is no unit.
    low, high : float or None
        Closed range of a number or of every element of a list.
    choices : tuple of str
        Allowed words, if only some are.
    length : int or None
        Number of elements of a list, if fixed.

    """

    name: str
    default: Any
    meaning: str
    unit: str = ''
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    length: int | None = None

    def check(self, value: Any) -> Any:
        """
        Return ``value`` in the parameter's own type.

        Raises
        ------
        ValueError
            If type, length, range or choice is wrong; the text names parameter and rule.

        """
        if isinstance(self.default, tuple):
            if isinstance(value, (str, bytes)) or not hasattr(value, '__len__'):
                raise ValueError(f"parameter '{self.name}' must be a list, not {value!r}")
            if self.length is not None and len(value) != self.length:
                raise ValueError(
                    f"parameter '{self.name}' needs {self.length} numbers, not {len(value)}")
            kind = self._element_type()
            return tuple(self._scalar(kind, item) for item in value)
        return self._scalar(type(self.default), value)

    def _element_type(self) -> type:
        return type(self.default[0]) if self.default else str

    def _scalar(self, kind: Any, value: Any) -> Any:
        wrong = ValueError(f"parameter '{self.name}' must be {_WORD[kind]}, not {value!r}")
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value) if abs(value) < 2**1000 else math.inf
        if type(value) is not kind:
            raise wrong
        if self.choices and value not in self.choices:
            raise ValueError(
                f"parameter '{self.name}' must be one of {', '.join(self.choices)}, not {value!r}")
        if kind in (int, float):
            unset = kind is float and math.isnan(value) and _has_nan(self.default)
            below = self.low is not None and not value >= self.low
            above = self.high is not None and not value <= self.high
            if not unset and (below or above or not math.isfinite(value)):
                raise ValueError(f"parameter '{self.name}' must be within "
                                 f"{self.span() or 'the finite numbers'}, not {value!r}")
        return value

    def span(self) -> str:
        """
        Say the range in words.

        >>> Parameter('horizon', 3.0, 'ahead', 's', 0.1, 10.0).span()
        '0.1 to 10 s'
        """
        unit = f' {self.unit}' if self.unit else ''
        if self.low is not None and self.high is not None:
            return f'{_short(self.low)} to {_short(self.high)}{unit}'
        if self.low is not None:
            return f'at least {_short(self.low)}{unit}'
        if self.high is not None:
            return f'at most {_short(self.high)}{unit}'
        return f'any{unit}' if unit else ''


_WORD = {float: 'a decimal number', int: 'a whole number', str: 'text', bool: 'true or false'}


def _short(number: float) -> str:
    return str(number) if isinstance(number, int) else f'{number:g}'


def _has_nan(default: Any) -> bool:
    return any(isinstance(item, float) and math.isnan(item)
               for item in (default if isinstance(default, tuple) else (default,)))


def parameter(default: Any, meaning: str, unit: str = '', low: float | None = None,
              high: float | None = None, choices: tuple[str, ...] = (),
              length: int | None = None) -> Any:
    """
    Declare a parameter as a dataclass field; see :class:`Parameter` for the arguments.

    A NaN default means "unset", and NaN is then allowed.
    """
    about = {'meaning': meaning, 'unit': unit, 'low': low, 'high': high, 'choices': choices,
             'length': length}
    return field(default=default, metadata=about)


def parameters(kind: type) -> dict[str, Parameter]:
    """
    List the parameters of a configuration class by name, in the order of its fields.

    Raises
    ------
    TypeError
        If a field has no default: every parameter needs one.

    """
    table = {}
    for item in fields(kind):
        if item.default is MISSING:
            raise TypeError(f'{kind.__name__}.{item.name} has no default')
        table[item.name] = Parameter(item.name, item.default, **item.metadata)
    return table


def configured(kind: type[T], values: Mapping[str, Any]) -> T:
    """
    Build a configuration from values by name, each checked; the others keep their default.

    Raises
    ------
    ValueError
        If a value breaks its parameter's rule or a name is unknown.

    """
    table = parameters(kind)
    unknown = unknown_names(kind, values)
    if unknown:
        raise ValueError(f"unknown parameter '{unknown[0]}'")
    return kind(**{name: table[name].check(value) for name, value in values.items()})


def unknown_names(kind: type, values: Mapping[str, Any]) -> list[str]:
    """
    Name the values that no parameter of ``kind`` takes, sorted.

    The two parameters every ROS node has, ``use_sim_time`` and the ``qos_overrides`` family, do
    not count.
    """
    known = parameters(kind)
    return sorted(name for name in values if name not in known and name != 'use_sim_time'
                  and not name.startswith('qos_overrides.'))
