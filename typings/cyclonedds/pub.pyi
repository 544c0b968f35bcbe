from typing import Generic, TypeVar

from cyclonedds.core import Entity, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.topic import Topic

S = TypeVar("S", bound=IdlStruct)

class DataWriter(Entity, Generic[S]):
    data_type: type[S]
    def __init__(
        self, publisher_or_participant: DomainParticipant, topic: Topic[S], qos: Qos | None = None
    ) -> None: ...
    def write(self, sample: S) -> None: ...
