import ctypes
from uuid import UUID

from cyclonedds.domain import DomainParticipant

class DDSException(Exception):
    msg: str

class DDSStatus:
    DataAvailable: int

class InstanceState:
    Alive: int

class BasePolicy: ...

class Policy:
    class Reliability:
        class Reliable(BasePolicy):
            def __init__(self, max_blocking_time: int) -> None: ...

    class Durability:
        Volatile: BasePolicy
        TransientLocal: BasePolicy

    class History:
        KeepAll: BasePolicy
        class KeepLast(BasePolicy):
            def __init__(self, depth: int) -> None: ...

    class DurabilityService(BasePolicy):
        def __init__(
            self,
            cleanup_delay: int,
            history: BasePolicy,
            max_samples: int,
            max_instances: int,
            max_samples_per_instance: int,
        ) -> None: ...

    class DataRepresentation(BasePolicy):
        def __init__(
            self, use_cdrv0_representation: bool = False, use_xcdrv2_representation: bool = False
        ) -> None: ...

    class Userdata(BasePolicy):
        def __init__(self, data: bytes) -> None: ...

class Qos:
    def __init__(self, *policies: BasePolicy) -> None: ...
    def __add__(self, other: Qos) -> Qos: ...

class Entity:
    _ref: int
    @property
    def guid(self) -> UUID: ...
    def set_status_mask(self, mask: int) -> None: ...
    def __del__(self) -> None: ...

class GuardCondition(Entity):
    def __init__(self, domain_participant: DomainParticipant) -> None: ...
    def set(self, triggered: bool) -> None: ...

class WaitSet(Entity):
    def __init__(self, domain_participant: DomainParticipant) -> None: ...
    def _waitset_attach(self, waitset: int, entity: int, x: int) -> int: ...
    def _waitset_wait(
        self, waitset: int, xs: ctypes._Pointer[ctypes.c_void_p], nxs: int, reltimeout: int
    ) -> int: ...
