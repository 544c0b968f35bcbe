"""Servers of policies, written to the protocols of openpi and GR00T."""

import threading
from contextlib import contextmanager

import numpy as np

from devices.policies.array_messages import pack_groot, pack_openpi, unpack

try:  # openpi's own code for messages, where its client is installed
    from openpi_client import msgpack_numpy

    pack, unpack_openpi = msgpack_numpy.packb, msgpack_numpy.unpackb
except ImportError:
    pack, unpack_openpi = pack_openpi, unpack


@contextmanager
def openpi_server(answer, metadata=None, port=0):
    """Serve on loopback; `answer(observation, connection)` returns a message, or None for silence.

    Yields the address and the list of observations.
    """
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.server import serve

    seen = []

    def handle(connection):
        connection.send(pack(metadata or {}))
        try:
            for message in connection:
                seen.append(unpack_openpi(message))
                if (answered := answer(seen[-1], connection)) is not None:
                    connection.send(answered)
        except ConnectionClosed:
            pass

    with serve(handle, "127.0.0.1", port, compression=None, max_size=None) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"openpi://127.0.0.1:{server.socket.getsockname()[1]}", seen
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def groot_server(answer, modalities=None):
    """Serve on loopback; `answer(endpoint, data)` returns a tree or bytes. Yields address and requests."""
    import zmq

    context = zmq.Context()
    socket = context.socket(zmq.REP)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    seen, ending = [], threading.Event()

    def run():
        while not ending.is_set():
            if not socket.poll(50):
                continue
            request = unpack(socket.recv())
            seen.append(request)
            if request["endpoint"] == "get_modality_config":
                answered = modalities or {"error": "Unknown endpoint: get_modality_config"}
            else:
                answered = answer(request["endpoint"], request.get("data"))
            socket.send(answered if isinstance(answered, bytes) else pack_groot(answered))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield f"groot://127.0.0.1:{port}", seen
    finally:
        ending.set()
        thread.join()
        socket.close(0)
        context.term()


def rows(count, width):
    """Return rows of numbers."""
    return np.arange(count * width, dtype=np.float32).reshape(count, width)
