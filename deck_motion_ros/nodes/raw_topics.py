"""Raw topics between rclpy and bags: quality of service, and taking without waking up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from deck_motion_ros.nodes.shell import output_qos
from deck_motion_ros.recording import fitting_offer, fitting_request
from deck_motion_ros.samples import NANOSECONDS


class Polled(MutuallyExclusiveCallbackGroup):
    """Subscriptions that the executor does not wait for: waking up costs more than a message."""

    def can_execute(self, entity: object) -> bool:
        """Leave subscriptions out."""
        return not isinstance(entity, Subscription) and bool(super().can_execute(entity))


def waiting(subscription: Subscription, limit: int) -> Iterator[tuple[bytes, dict[str, Any]]]:
    """Yield the messages that wait in a raw subscription and what is known of each."""
    with subscription.handle:
        for _ in range(limit):
            taken = subscription.handle.take_message(subscription.msg_type, True)
            if taken is None:
                return
            yield taken


def stored_qos(profile: QoSProfile) -> Qos:
    """Return a profile as bags store it."""
    def time(duration: Duration) -> QosTime:
        return QosTime(*divmod(duration.nanoseconds, NANOSECONDS))

    return Qos(QosHistory(profile.history.value), profile.depth,
               QosReliability(profile.reliability.value), QosDurability(profile.durability.value),
               time(profile.deadline), time(profile.lifespan),
               QosLiveliness(profile.liveliness.value), time(profile.liveliness_lease_duration),
               profile.avoid_ros_namespace_conventions)


def request(offers: Sequence[Qos], depth: int) -> tuple[QoSProfile, bool]:
    """Return the profile to subscribe with, and whether the publishers differ."""
    reliability, durability, mixed = fitting_request(offers)
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy(reliability.value),
                      durability=DurabilityPolicy(durability.value)), mixed


def offer(recorded: Sequence[Qos]) -> QoSProfile:
    """Return the profile to publish with: what all recorded publishers offered, if they agree."""
    qos = fitting_offer(recorded)
    if qos is None:
        return output_qos()

    def duration(time: QosTime) -> Duration:
        return Duration(nanoseconds=time.sec * NANOSECONDS + time.nsec)

    latched = qos.durability is QosDurability.TRANSIENT_LOCAL
    return QoSProfile(
        depth=qos.depth or (10 if latched else 100),
        reliability=ReliabilityPolicy(qos.reliability.value),
        durability=DurabilityPolicy(qos.durability.value),
        deadline=duration(qos.deadline), lifespan=duration(qos.lifespan),
        liveliness=LivelinessPolicy(qos.liveliness.value),
        liveliness_lease_duration=duration(qos.liveliness_lease_duration))
