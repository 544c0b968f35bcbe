"""What Trocar uses of zenoh.ext."""

from zenoh import CongestionControl, Encoding, Priority, Sample, Session
from zenoh.handlers import Callback

class CacheConfig:
    def __init__(self, max_samples: int | None = None) -> None: ...

class MissDetectionConfig:
    def __init__(self, *, heartbeat: float | None = None) -> None: ...

class AdvancedPublisher:
    def put(self, payload: bytes, *, attachment: bytes | None = None) -> None: ...
    def undeclare(self) -> None: ...

def declare_advanced_publisher(
    session: Session,
    key_expr: str,
    *,
    encoding: Encoding | None = None,
    congestion_control: CongestionControl | None = None,
    priority: Priority | None = None,
    express: bool | None = None,
    cache: CacheConfig | None = None,
    sample_miss_detection: MissDetectionConfig | None = None,
    publisher_detection: bool | None = None,
) -> AdvancedPublisher: ...

class HistoryConfig:
    def __init__(
        self, *, detect_late_publishers: bool | None = None, max_samples: int | None = None
    ) -> None: ...

class RecoveryConfig:
    def __init__(self, *, heartbeat: bool | None = None) -> None: ...

class AdvancedSubscriber:
    def undeclare(self) -> None: ...

def declare_advanced_subscriber(
    session: Session,
    key_expr: str,
    handler: Callback[Sample],
    *,
    history: HistoryConfig | None = None,
    recovery: RecoveryConfig | None = None,
) -> AdvancedSubscriber: ...
