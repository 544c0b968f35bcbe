"""What the gateway offers on a domain by its own RTPS participant: services and subscriptions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from devices.ros.transport import ServiceHandler

__all__ = ["ReceiveSample", "Service", "Subscription"]

ReceiveSample = Callable[[bytes, bytes], None]
"""Receives a message (CDR) and the GUID of the participant that has published it."""


@dataclass(frozen=True, slots=True)
class Service:
    """A service: a reader of requests and a writer of responses. EntityIds have 4 bytes."""

    request_topic: str
    response_topic: str
    type: str
    """Of both without `Request_` and `Response_`: `crtk_msgs::srv::dds_::QueryForwardKinematics_`."""
    reader_id: bytes
    """Of requests."""
    writer_id: bytes
    """Of responses."""
    handle: ServiceHandler


@dataclass(frozen=True, slots=True)
class Subscription:
    """A reader of a topic, reliable and volatile."""

    topic: str
    type: str
    """`crtk_msgs::msg::dds_::StringStamped_`."""
    reader_id: bytes
    user_data: str
    receive: ReceiveSample
