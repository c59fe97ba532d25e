"""A row of the papers' table: what ours gives, what the paper prints, what theory allows."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """
    One figure of an experiment.

    Attributes
    ----------
    paper, name : str
        Key of the paper; what outside programs read the figure by.
    value, unit
        What ours gives.
    printed, floor : float or None
        What the paper prints and the best that theory allows, where there is such a figure.

    """

    paper: str
    name: str
    value: float
    unit: str
    printed: float | None = None
    floor: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the row as ``deck_motion papers --json`` writes it."""
        return asdict(self)
