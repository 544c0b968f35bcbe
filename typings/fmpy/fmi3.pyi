from collections.abc import Callable
from ctypes import CDLL

class FMU3Model: ...

class FMU3Slave:
    dll: CDLL
    component: int | None
    def __init__(
        self, *, guid: str, modelIdentifier: str, unzipDirectory: str, instanceName: str
    ) -> None: ...
    def instantiate(
        self,
        visible: bool = False,
        loggingOn: bool = False,
        eventModeUsed: bool = False,
        earlyReturnAllowed: bool = False,
        logMessage: Callable[[int | None, int, bytes, bytes], None] | None = None,
    ) -> None: ...
    def freeLibrary(self) -> None: ...
