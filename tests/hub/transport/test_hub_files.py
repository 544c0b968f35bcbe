import socket

import pytest

from hub.transport import endpoints
from hub.transport.hub_files import HubFile, hub_endpoints, hub_file, running_hubs


@pytest.fixture
def home(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setenv("APPDATA", str(tmp_path))
    monkeypatch.setattr("typer.get_app_dir", lambda name: str(tmp_path / name))
    monkeypatch.setattr(endpoints, "PORTS", [])
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
        assert hub_endpoints([hub]) == [_endpoint(listener)]
    assert running_hubs() == []
    assert not list(home.rglob("*.json"))


def test_the_file_of_a_hub_that_was_killed_is_deleted_when_it_is_met(home, listener):
    with hub_file(_endpoint(listener), []):
        assert [type(hub) for hub in running_hubs()] == [HubFile]
        listener.close()
        assert running_hubs() == []
        assert not list(home.rglob("*.json"))


def test_something_else_among_the_files_is_ignored(home, listener):
    with hub_file(_endpoint(listener), []):
        (file,) = home.rglob("*.json")
        (file.parent / "other.json").write_text("{")
        assert [hub.endpoint for hub in running_hubs()] == [_endpoint(listener)]


def test_a_session_runs_where_no_file_can_be_written(home, listener, caplog):
    (home / "trocar").write_text("in the way")
    with hub_file(_endpoint(listener), []):
        assert running_hubs() == []
    assert "trocar ls will not list this session by itself" in caplog.text
