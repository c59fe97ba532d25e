"""Topic names as ROS resolves them: namespace first, then remappings."""

from __future__ import annotations

from collections.abc import Iterable


def absolute(name: str, namespace: str = '/') -> str:
    """
    Resolve a topic name in a namespace.

    >>> absolute('ship/imu', 'palmer'), absolute('/diagnostics', 'palmer')
    ('/palmer/ship/imu', '/diagnostics')
    """
    if name.startswith('/'):
        return name
    return f"/{namespace.strip('/')}/{name}".replace('//', '/')


def remappings(rules: Iterable[str], namespace: str = '/') -> dict[str, str]:
    """
    Read rules such as ``ship/imu:=mru/imu`` into absolute names.

    Raises
    ------
    ValueError
        If a rule has no ``:=`` between two names.

    """
    table = {}
    for rule in rules:
        old, arrow, new = rule.partition(':=')
        if not (arrow and old and new):
            raise ValueError(f"'{rule}' is no remapping: write old:=new")
        table[absolute(old, namespace)] = absolute(new, namespace)
    return table
