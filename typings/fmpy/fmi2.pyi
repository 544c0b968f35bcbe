from collections.abc import Callable
from ctypes import CDLL, Structure
from typing import Any

fmi2CallbackLoggerTYPE: Callable[..., Any]
fmi2CallbackAllocateMemoryTYPE: Callable[..., Any]
fmi2CallbackFreeMemoryTYPE: Callable[..., Any]

class fmi2CallbackFunctions(Structure):
    logger: Any
    allocateMemory: Any
    freeMemory: Any

class fmi2EventInfo(Structure):
    newDiscreteStatesNeeded: int
    terminateSimulation: int
    nextEventTimeDefined: int
    nextEventTime: float

class FMU2Model: ...

class FMU2Slave:
    dll: CDLL
    component: int | None
    def __init__(
        self, *, guid: str, modelIdentifier: str, unzipDirectory: str, instanceName: str
    ) -> None: ...
    def instantiate(
        self, visible: bool = ..., callbacks: fmi2CallbackFunctions | None = None, loggingOn: bool = False
    ) -> None: ...
    def freeLibrary(self) -> None: ...
