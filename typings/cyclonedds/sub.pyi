from typing import Generic, TypeVar

from cyclonedds.core import Entity, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.internal import InvalidSample
from cyclonedds.topic import Topic

S = TypeVar("S", bound=IdlStruct)

class DataReader(Entity, Generic[S]):
    def __init__(
        self, subscriber_or_participant: DomainParticipant, topic: Topic[S], qos: Qos | None = None
    ) -> None: ...
    def take(self, N: int = 1) -> list[S | InvalidSample]: ...
