"""The outputs of a participant due together: checked, and passed on to readers, if any.

Unchanged values cost nothing here: arrays remaining the same objects are given to their readers once, equal
bits are checked once, and event ports without a message are passed over all at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter, is_, itemgetter
from typing import Any

import numpy as np

from hub.participant import Outputs
from hub.transport.cells import INITIAL, Cell
from hub.transport.port_publisher import PortPublisher
from hub.transport.reader import Queue
from hub.transport.wire import Wire
from schemas import ros
from schemas.errors import MessageError
from schemas.magnitudes import ABSURD
from schemas.ports import Port
from schemas.vectors import Vector, VectorCodec, join_parts

__all__ = ["DueOutputs", "Listener", "Output", "VectorsListener"]

Listener = Callable[[int, int, Any], None]
"""Is called with every value of an output: step, time of validity (ns), value."""

_PHYSICAL = frozenset(
    model.ros_type
    for model in (
        ros.JointState,
        ros.PointStamped,
        ros.PoseStamped,
        ros.TransformStamped,
        ros.TwistStamped,
        ros.Vector3,
        ros.WrenchStamped,
    )
)
"""Types with forces, states and their rates as numbers; all further types may hold any number."""
_ABSURD_SQUARE = ABSURD**2

VectorsListener = Callable[[int, int, bytes], None]
"""Is called with the vectors of outputs: step, time of validity (ns), and their bytes, joined."""


@dataclass(slots=True)
class Output:
    """An output port and all destinations of the value."""

    port: Port
    codec: VectorCodec | None
    """Codec of a vector; None for messages and events."""
    copied: bool
    """Whether readers get a copy: the owner may write to the array before the next value is due."""
    cell: Cell | None
    """Cell for readers in this process looking back."""
    publisher: PortPublisher | None
    """Publisher for readers in remote processes."""
    listener: Listener | None
    """Listener for messages and events."""
    inputs: list[tuple[dict[str, Any], str]] = field(default_factory=list[tuple[dict[str, Any], str]])
    """The inputs in this process holding the newest value: the values of a participant, and the port."""
    queues: list[Queue] = field(default_factory=list[Queue])
    """The event inputs in this process receiving all messages."""

    watched: bool = False
    """Whether a measure or the recorder uses the values."""

    @property
    def is_used(self) -> bool:
        """Whether anybody uses the values now."""
        here = self.watched or self.inputs or self.queues or self.cell is not None
        return bool(here) or (self.publisher is not None and self.publisher.needed)

    def set_inputs(self, value: Any) -> None:
        """Write `value` into the inputs holding the newest value."""
        for values, port in self.inputs:
            values[port] = value


_layout = attrgetter("shape", "dtype")


class _Passage:
    """Passage of the values of some outputs, at every step with values due; `wire` None: in this process."""

    def __init__(self, outputs: Sequence[Output], wire: Wire | None) -> None:
        self._wire = wire
        self._cells = [(i, output.cell) for i, output in enumerate(outputs) if output.cell is not None]
        self._publishers = [(i, output.publisher) for i, output in enumerate(outputs) if output.publisher]
        self._listeners = [(i, output.listener) for i, output in enumerate(outputs) if output.listener]
        self._needed: list[tuple[int, PortPublisher]] = []
        self._changes = -1

    def put(self, step: int, time_ns: int, values: Sequence[Any]) -> None:
        """Pass on the values computed in `step`, valid at `time_ns`."""
        if self._wire is not None:
            if self._changes != self._wire.noted:
                self._changes = self._wire.noted
                self._needed = [one for one in self._publishers if one[1].needed]
            for i, publisher in self._needed:
                publisher.put(step, time_ns, values[i])
        for i, cell in self._cells:
            cell.put(step, values[i])
        for i, listener in self._listeners:
            listener(step, time_ns, values[i])


class _Vectors:
    """Vectors due together."""

    def __init__(
        self, outputs: Sequence[Output], wire: Wire | None, listener: VectorsListener | None
    ) -> None:
        self._listener = listener
        self._values: Sequence[Vector] = ()
        self._views: Sequence[memoryview] = ()
        """Views of the arrays, joined at a tenth of the cost of the arrays."""
        self._bytes = b""
        self._codecs = [output.codec for output in outputs if output.codec is not None]
        self._layouts = [_layout(codec.neutral) for codec in self._codecs]
        self._size = sum(codec.neutral.nbytes for codec in self._codecs)
        read = [(i, output) for i, output in enumerate(outputs) if output.inputs]
        self._shared = [(i, output) for i, output in read if not output.copied]
        self._copied = [(i, output) for i, output in read if output.copied]
        self._passage = _Passage(outputs, wire)

    def put(self, step: int, time_ns: int, values: Sequence[Vector]) -> None:
        before, self._values = self._values, values
        same = len(before) == len(values) and all(map(is_, values, before))
        if not same:
            self._views = ()
            if not self._fits(values):
                self._check(values)
        elif not self._views:
            self._views = tuple(value.data for value in values)
        data = join_parts(self._views or values)
        if data != self._bytes:
            self._bytes = data
            if len(data) != self._size or not _has_sense(data) or step == INITIAL:
                self._check(values)  # raises what is wrong, unless the numbers are only large
            for i, output in self._copied:
                output.set_inputs(values[i].copy())
        if not same:
            for i, output in self._shared:
                output.set_inputs(values[i])
        self._passage.put(step, time_ns, values)
        if self._listener is not None:
            self._listener(step, time_ns, data)

    def _fits(self, values: Sequence[Vector]) -> bool:
        try:
            return list(map(_layout, values)) == self._layouts
        except AttributeError:  # one is no array
            return False

    def _check(self, values: Sequence[Vector]) -> None:
        for codec, value in zip(self._codecs, values, strict=True):
            codec.check_vector(value)
            if codec.port.type in _PHYSICAL and (size := float(np.abs(value).max(initial=0.0))) > ABSURD:
                raise MessageError(
                    f"output '{codec.port.name}' has a size of {size:.3g} in SI units, which has no meaning"
                    f" (more than {ABSURD:g}): the simulation has become unstable, or a parameter is out of"
                    " any sense"
                )


class _Messages:
    """Signals without a vector form, due together."""

    def __init__(self, outputs: Sequence[Output], wire: Wire | None) -> None:
        self._read = [(i, output) for i, output in enumerate(outputs) if output.inputs]
        self._passage = _Passage(outputs, wire)

    def put(self, step: int, time_ns: int, values: Sequence[Any]) -> None:
        for i, output in self._read:
            output.set_inputs(values[i])
        self._passage.put(step, time_ns, values)


class _Events:
    """Event ports due together; the value of each is a tuple of messages."""

    def __init__(self, outputs: Sequence[Output], wire: Wire | None) -> None:
        self._read = [(i, output.queues) for i, output in enumerate(outputs) if output.queues]
        self._passage = _Passage(outputs, wire)
        self._passes_none = any(o.cell or (o.publisher and o.publisher.always) for o in outputs)

    def put(self, step: int, time_ns: int, values: Sequence[Any]) -> None:
        if any(values):
            for i, queues in self._read if step > INITIAL else ():
                for queue in queues:
                    queue.arrived += values[i]
        elif not self._passes_none:
            return
        self._passage.put(step, time_ns, values)


class DueOutputs:
    """The outputs of a participant with the same stride.

    Args:
        outputs: The outputs, in the order of publication.
        wire: Carries values to other processes; None without any.
        listener: Returns the listener for the vectors among some outputs.
    """

    def __init__(
        self,
        outputs: Sequence[Output],
        wire: Wire | None,
        listener: Callable[[Sequence[Port]], VectorsListener | None] = lambda _: None,
    ) -> None:
        vectors = [output for output in outputs if output.codec is not None]
        events = [output for output in outputs if output.port.variability == "event"]
        messages = [
            output for output in outputs if output.codec is None and output.port.variability == "signal"
        ]
        self._parts: list[tuple[Callable[[Outputs], Sequence[Any]], Callable[[int, int, Any], None]]] = []
        if vectors:
            part = _Vectors(vectors, wire, listener([output.port for output in vectors]))
            self._parts.append((_values_of(vectors), part.put))
        for kind, part in ((_Messages, messages), (_Events, events)):
            if part:
                self._parts.append((_values_of(part), kind(part, wire).put))
        self._outputs = outputs
        self._initial: list[tuple[PortPublisher, Any]] = []

    def put(self, step: int, time_ns: int, returned: Outputs) -> None:
        """Check and pass on the values computed in `step`, valid at `time_ns`.

        Raises MessageError if a value is missing or invalid.
        """
        for values_of, put in self._parts:
            try:
                values = values_of(returned)
            except KeyError:
                missing = next(o.port.name for o in self._outputs if o.port.name not in returned)
                raise MessageError(f"output '{missing}' is missing from what step() returned") from None
            put(step, time_ns, values)
        if step == INITIAL:
            self._keep(returned)

    def _keep(self, returned: Outputs) -> None:
        """Keep the values at time 0, published until all hosts have received these values."""
        for output in self._outputs:
            if output.publisher is not None:
                value: Any = returned[output.port.name]
                self._initial.append((output.publisher, value if output.codec is None else value.copy()))
                output.publisher.keep_first(value)

    def put_initial_again(self) -> None:
        """Publish the values at time 0 once more."""
        for publisher, value in self._initial:
            publisher.look()
            publisher.put(INITIAL, 0, value, again=True)


def _values_of(outputs: Sequence[Output]) -> Callable[[Outputs], Sequence[Any]]:
    """Return a getter of the values of `outputs` from a participant's returned values; may raise KeyError."""
    names = [output.port.name for output in outputs]
    if len(names) > 1:
        return itemgetter(*names)

    def only(returned: Mapping[str, Any]) -> Sequence[Any]:
        return (returned[names[0]],)

    return only


def _has_sense(data: bytes) -> bool:
    """Return whether all numbers are finite, and small enough for every physical quantity."""
    numbers = np.frombuffer(data)
    return bool(numbers.dot(numbers) < _ABSURD_SQUARE)  # false for NaN
