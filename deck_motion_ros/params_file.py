"""ROS 2 parameter files without ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
import re
from typing import Any


def read_params_file(path: Path, node: str, namespace: str = '/') -> dict[str, Any]:
    """
    Read the parameters that a file gives to one node; later sections win.

    Parameters
    ----------
    path : Path
        A ROS 2 parameter file: node names, wildcards (``/**``, ``/*/predictor``) included, each
        over ``ros__parameters``.
    node, namespace : str
        The node's own name and namespace.

    Returns
    -------
    dict
        Values by name, nested names joined with dots.

    Raises
    ------
    ValueError
        If the file is not such a file; the text names it.
    OSError
        If it cannot be read.

    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        tree = YAML(typ='safe').load(path) or {}
    except (YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f'{path}: not YAML ({str(error).splitlines()[0]})') from None
    if not isinstance(tree, Mapping):
        raise ValueError(f'{path}: not a ROS 2 parameter file')
    full_name = f"/{namespace.strip('/')}/{node}".replace('//', '/')
    values: dict[str, Any] = {}
    for pattern, branch in _sections(tree, ''):
        if not isinstance(branch, Mapping):
            raise ValueError(f"{path}: 'ros__parameters' of {pattern} holds no parameters")
        if _matches(pattern, full_name):
            values.update(_flat(branch, ''))
    return values


def _sections(tree: Mapping[str, Any], prefix: str) -> list[tuple[str, Any]]:
    found = []
    for key, branch in tree.items():
        if key == 'ros__parameters':
            found.append((prefix, branch))
        elif isinstance(branch, Mapping):
            found += _sections(branch, f"{prefix}/{str(key).strip('/')}")
    return found


def _matches(pattern: str, full_name: str) -> bool:
    regex = re.escape(pattern).replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'/\w+')
    return re.fullmatch(regex, full_name) is not None


def _flat(branch: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in branch.items():
        if isinstance(value, Mapping):
            values.update(_flat(value, f'{prefix}{key}.'))
        else:
            values[f'{prefix}{key}'] = value
    return values


def parse_assignments(rules: Sequence[str]) -> dict[str, Any]:
    """
    Read assignments such as ``horizon:=4.0``; values are YAML, as on ROS 2's command line.

    Raises
    ------
    ValueError
        If a rule has no ``:=`` or its value is not YAML.

    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    values = {}
    for rule in rules:
        name, arrow, text = rule.partition(':=')
        try:
            if not (arrow and name):
                raise ValueError(f"'{rule}' sets no parameter: write name:=value")
            values[name] = YAML(typ='safe').load(text)
        except YAMLError:
            raise ValueError(f"'{rule}': the value is not YAML") from None
    return values
