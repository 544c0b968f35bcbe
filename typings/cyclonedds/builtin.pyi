from uuid import UUID

from cyclonedds.core import Entity
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import SampleInfo

class DcpsEndpoint:
    key: UUID
    participant_key: UUID
    topic_name: str
    sample_info: SampleInfo

class BuiltinTopic: ...

class BuiltinDataReader(Entity):
    def __init__(self, subscriber_or_participant: DomainParticipant, builtin_topic: BuiltinTopic) -> None: ...
    def take(self, N: int = 1) -> list[DcpsEndpoint]: ...

BuiltinTopicDcpsPublication: BuiltinTopic
BuiltinTopicDcpsSubscription: BuiltinTopic
