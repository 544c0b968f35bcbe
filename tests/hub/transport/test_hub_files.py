import socket
import tempfile

import pytest

from hub.transport.hub_files import HubFile, hub_file, only_hub, running_hubs
from schemas.errors import ConnectError


@pytest.fixture
def home(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture
def listener():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener


def _endpoint(listener):
    return f"tcp/127.0.0.1:{listener.getsockname()[1]}"


def test_a_hub_at_any_port_is_found_while_it_runs(home, listener):
    with hub_file(_endpoint(listener), ["tls/0.0.0.0:7447"]):
        (hub,) = running_hubs()
        assert (hub.endpoint, hub.outside) == (_endpoint(listener), ("tls/0.0.0.0:7447",))
    assert running_hubs() == []
    assert not list(home.rglob("*.json"))


def test_the_file_of_a_hub_that_was_killed_is_deleted_when_it_is_met(home, listener):
    with hub_file(_endpoint(listener), []):
        assert [type(hub) for hub in running_hubs()] == [HubFile]
        listener.close()
        assert running_hubs() == []
        assert not list(home.rglob("*.json"))


@pytest.mark.parametrize("error", [TimeoutError, ConnectionResetError])
def test_a_hub_that_is_busy_or_about_to_end_is_still_one(home, listener, monkeypatch, error):
    def refuse(*_):
        raise error

    with hub_file(_endpoint(listener), []):
        monkeypatch.setattr(socket, "create_connection", refuse)
        assert [hub.endpoint for hub in running_hubs()] == [_endpoint(listener)]


def test_something_else_among_the_files_is_ignored(home, listener):
    with hub_file(_endpoint(listener), []):
        (file,) = home.rglob("*.json")
        (file.parent / "other.json").write_text("{")
        assert [hub.endpoint for hub in running_hubs()] == [_endpoint(listener)]


def test_a_device_of_this_machine_finds_the_only_hub(home, listener):
    with pytest.raises(ConnectError, match="no hub of this user runs on this machine"):
        only_hub()
    with socket.create_server(("127.0.0.1", 0)) as other, hub_file(_endpoint(other), []):
        assert only_hub() == _endpoint(other)
        with hub_file(_endpoint(listener), []), pytest.raises(ConnectError, match=r"2 hubs run .*--connect"):
            only_hub()
