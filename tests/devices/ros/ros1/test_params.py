"""Where a gateway to ROS 1 looks for its master and where it listens: without a master, and without ROS."""

import xmlrpc.client

import pytest
from pydantic import ValidationError

from devices.ros.ros1.gateway import Ros1Gateway
from schemas.errors import DeviceError
from tests.hub.authorities import free_port
from tests.waiting import until

ARM = {"arms": {"PSM1": {}}, "cameras": []}


def gateway(**params):
    return Ros1Gateway("ros", Ros1Gateway.params_model.model_validate(ARM | params))


def test_without_a_master_it_waits_and_says_so_once(tmp_path, caplog, monkeypatch):
    uri = f"http://127.0.0.1:{free_port()}"
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    monkeypatch.setenv("ROS_HOSTNAME", "nowhere.invalid")
    with gateway() as it:
        for times in (1, 2):
            it.open(tmp_path)
            said = f"waiting for the master: {uri} does not answer"
            assert until(lambda times=times, said=said: caplog.text.count(said) == times)
            it.close()
    assert caplog.text.count(said) == 2


def test_it_listens_at_the_address_towards_its_master_only(tmp_path):
    with gateway(master=f"http://localhost:{free_port()}") as it:
        it.open(tmp_path)
        server = it._transport._server.uri
        assert server.startswith("http://127.0.0.1:")
        assert xmlrpc.client.ServerProxy(server).getPid("/somebody")[0] == 1
        code, _, (protocol, host, _) = xmlrpc.client.ServerProxy(server).requestTopic(
            "/somebody", "/PSM1/measured_js", [["UDPROS"], ["TCPROS"]]
        )
        assert (code, protocol, host) == (1, "TCPROS", "127.0.0.1")
        for topic, protocols in (("/PSM1/measured_js", [["UDPROS"]]), ("/nothing", [["TCPROS"]])):
            assert xmlrpc.client.ServerProxy(server).requestTopic("/somebody", topic, protocols)[0] == 0
        with pytest.raises(xmlrpc.client.Fault):
            xmlrpc.client.ServerProxy(server).requestTopic("/somebody")


@pytest.mark.parametrize(
    ("params", "words"),
    [
        (
            {"master": "http://nowhere.invalid:11311"},
            "no route to the ROS master at 'http://nowhere.invalid:11311'",
        ),
        ({"master": "http://127.0.0.1:11311", "ip": "192.0.2.1"}, "cannot listen at 192.0.2.1"),
    ],
)
def test_addresses_that_cannot_be_are_told(tmp_path, params, words):
    with gateway(**params) as it, pytest.raises(DeviceError, match=words):
        it.open(tmp_path)


@pytest.mark.parametrize(
    "params",
    [
        {"master": "127.0.0.1:11311"},
        {"master": "http://here"},
        {"ip": "here"},
        {"ip": "0.0.0.0"},
        {"ip": "::1"},
    ],
)
def test_addresses_that_are_none_are_refused(params):
    with pytest.raises(ValidationError):
        gateway(**params)
