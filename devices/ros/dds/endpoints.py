"""Services and subscriptions of the gateway's own RTPS participant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from devices.ros.transport import ServiceHandler

__all__ = ["ReceiveSample", "Service", "Subscription"]

ReceiveSample = Callable[[bytes, bytes], None]
"""Receives a message (CDR) and the GUID of the publishing participant."""


@dataclass(frozen=True, slots=True)
class Service:
    """A service: a reader of requests and a writer of responses. EntityIds have 4 bytes."""

    request_topic: str
    response_topic: str
    type: str
    """DDS type without `Request_` and `Response_`: `crtk_msgs::srv::dds_::QueryForwardKinematics_`."""
    reader_id: bytes
    """EntityId of the reader of requests."""
    writer_id: bytes
    """EntityId of the writer of responses."""
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
