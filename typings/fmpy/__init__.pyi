from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from fmpy.model_description import ModelDescription

platform: str
platform_tuple: str
sharedLibraryExtension: str
calloc: Callable[..., Any]
free: Callable[..., Any]

def extract(filename: str | Path, unzipdir: str | Path | None = None) -> Path: ...
def read_model_description(filename: str | Path | IO[bytes], validate: bool = True) -> ModelDescription: ...
