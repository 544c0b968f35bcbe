"""Messages of a recording by time: hosts are recorded in blocks, so the order of writing is another."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from heapq import heappop, heappush
from itertools import accumulate, count

from hub.recording.bag import Bag, BagMessage

__all__ = ["messages_by_time"]


def messages_by_time(bag: Bag, *topics: str) -> Iterator[BagMessage]:
    """Yield the messages of `topics`, or all, by time; at the same time, in the order of writing.

    Raises RecordingError for a missing topic.
    """
    chunks = bag.chunks
    starts = (one.message_start_time for one in reversed(chunks))
    least = [sys.maxsize, *accumulate(starts, min)]
    later = {one.chunk_start_offset: start for one, start in zip(reversed(chunks), least, strict=False)}
    """The earliest time in the chunks after each chunk."""
    waiting: list[tuple[int, int, BagMessage]] = []
    number = count()
    for chunk, messages in bag.chunked_messages(topics):
        for message in messages:
            heappush(waiting, (message.time_ns, next(number), message))
        while waiting and waiting[0][0] < later[chunk.chunk_start_offset]:
            yield heappop(waiting)[2]
    while waiting:
        yield heappop(waiting)[2]
