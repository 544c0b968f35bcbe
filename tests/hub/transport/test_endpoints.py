import pytest

from hub.transport import endpoints as endpoint
from hub.transport.endpoints import require_loopback
from schemas.errors import ScenarioError


@pytest.mark.parametrize(
    ("where", "parts"), [("tls/hub.example:7447", ("hub.example", 7447)), ("tcp/[::1]:80", ("::1", 80))]
)
def test_an_endpoint_has_a_host_and_a_port(where: str, parts: tuple[str, int]) -> None:
    assert endpoint.address(where) == parts


@pytest.mark.parametrize(
    "where", ["hub.example:7447", "tls/hub.example", "tls/:7447", "tls/hub.example:port"]
)
def test_an_invalid_endpoint_is_refused_with_an_example(where: str) -> None:
    with pytest.raises(ScenarioError, match="write tls/HOST:PORT"):
        endpoint.address(where)


@pytest.mark.parametrize("where", ["tcp/127.0.0.1:7447", "tcp/localhost:0", "tcp/[::1]:7447"])
def test_a_hub_may_listen_on_loopback(where: str) -> None:
    assert require_loopback(where) == where


@pytest.mark.parametrize(
    "where",
    [
        "tcp/0.0.0.0:7447",
        "tcp/192.168.1.2:7447",
        "tcp/[::]:7447",
        "udp/127.0.0.1:7447",
        "tcp/hub:7447",
        "nonsense",
    ],
)
def test_a_hub_does_not_listen_elsewhere(where: str) -> None:
    with pytest.raises(ScenarioError, match="a hub listens on loopback"):
        require_loopback(where)
