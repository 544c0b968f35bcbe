"""A network between a hub and a host that tests can hold and cut."""

import shutil
import socket
import threading
from contextlib import suppress

from hub.transport.session_secret import private_directory


class Proxy:
    """Forwards TCP connections to a port of this machine."""

    def __init__(self, port, secrets=None):
        """`secrets`: the directory with the secret of the hub at `port`, if not that of this process."""
        self._target = port
        self._flowing = threading.Event()
        self._flowing.set()
        self._open = True
        self._pairs = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        secrets = private_directory() if secrets is None else secrets
        self._secret = secrets / str(self.port)
        shutil.copy(secrets / str(port), self._secret)
        self._start(self._accept)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.cut()
        self._flowing.set()
        self._listener.close()
        self._secret.unlink()

    def hold(self):
        """Let nothing through, and keep what arrives for later."""
        self._flowing.clear()

    def go_on(self):
        """Let everything through again."""
        self._flowing.set()
        self._open = True

    def cut(self):
        """Close all connections, and whatever is opened until `go_on`."""
        self._open = False
        for pair in self._pairs:
            for end in pair:
                self._close(end)
        self._pairs = []

    def _accept(self):
        while True:
            try:
                here, _ = self._listener.accept()
            except OSError:
                return
            there = self._reach() if self._open else None
            if there is None:
                here.close()
                continue
            for end in (here, there):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._pairs.append((here, there))
            self._start(self._forward, here, there)
            self._start(self._forward, there, here)

    def _reach(self):
        try:
            return socket.create_connection(("127.0.0.1", self._target))
        except OSError:  # the hub is gone
            return None

    def _forward(self, source, target):
        with suppress(OSError):
            while data := source.recv(65536):
                self._flowing.wait()
                target.sendall(data)
        for end in (source, target):
            self._close(end)

    @staticmethod
    def _close(end):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)  # wakes the thread that reads from it
        end.close()

    @staticmethod
    def _start(work, *arguments):
        threading.Thread(target=work, args=arguments, daemon=True).start()
