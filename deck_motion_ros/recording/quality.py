"""Quality of service: what to request from several publishers, what to offer on replay."""

from __future__ import annotations

from collections.abc import Sequence

from rosbags.interfaces import Qos, QosDurability, QosReliability


def fitting_request(offers: Sequence[Qos]) -> tuple[QosReliability, QosDurability, bool]:
    """
    Choose what a subscription requests so that every publisher fits, as rosbag2 does.

    Returns
    -------
    reliability, durability
        The stronger one if all offer it, else the weaker one.
    mixed : bool
        Whether the publishers differ, so that messages of the stronger ones may be missing.

    """
    reliable = [offer.reliability is QosReliability.RELIABLE for offer in offers]
    latched = [offer.durability is QosDurability.TRANSIENT_LOCAL for offer in offers]
    return (QosReliability.RELIABLE if all(reliable) else QosReliability.BEST_EFFORT,
            QosDurability.TRANSIENT_LOCAL if all(latched) else QosDurability.VOLATILE,
            len(set(reliable)) > 1 or len(set(latched)) > 1)


def fitting_offer(offers: Sequence[Qos]) -> Qos | None:
    """Return what all recorded publishers offered (history aside); None = they differ."""
    if not offers or any(_matters(offer) != _matters(offers[0]) for offer in offers):
        return None
    return offers[0]


def _matters(offer: Qos) -> tuple[object, ...]:
    return (offer.reliability, offer.durability, offer.deadline, offer.liveliness,
            offer.liveliness_lease_duration)
