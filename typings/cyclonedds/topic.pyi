from typing import Generic, TypeVar

from cyclonedds.core import Entity
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct

S = TypeVar("S", bound=IdlStruct)

class Topic(Entity, Generic[S]):
    def __init__(
        self, domain_participant: DomainParticipant, topic_name: str, data_type: type[S]
    ) -> None: ...
