from collections.abc import Mapping
from typing import Any, Self, TypeVar, overload

from cyclonedds.internal import SampleInfo

S = TypeVar("S", bound=IdlStruct)

class IdlStruct:
    sample_info: SampleInfo
    def serialize(
        self, buffer: object = None, endianness: object = None, use_version_2: bool | None = None
    ) -> bytes: ...
    @classmethod
    def deserialize(cls, data: bytes, has_header: bool = True, use_version_2: bool | None = None) -> Self: ...
    @classmethod
    def deserialize_key(
        cls, data: bytes, has_header: bool = True, use_version_2: bool | None = None
    ) -> Self: ...

@overload
def make_idl_struct(class_name: str, typename: str, fields: Mapping[str, Any]) -> type[IdlStruct]: ...
@overload
def make_idl_struct(
    class_name: str,
    typename: str,
    fields: Mapping[str, Any],
    *,
    dataclassify: bool = True,
    bases: tuple[type[S]],
) -> type[S]: ...
