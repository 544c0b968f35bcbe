from typing import Any

array: Any
sequence: Any
bounded_str: Any
int8: Any
uint8: Any
int16: Any
uint16: Any
int32: Any
uint32: Any
int64: Any
uint64: Any
float32: Any
float64: Any
