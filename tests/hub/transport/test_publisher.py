"""A publisher and subscribers that have just come."""

import pytest
import zenoh

from hub.transport.publisher import Publisher

KEY = "trocar/test/publisher"


@pytest.fixture
def session():
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    with zenoh.open(config) as session:
        yield session


def test_a_subscriber_of_which_nothing_was_told_yet_is_found_by_a_look(session, monkeypatch):
    monkeypatch.setattr(Publisher, "_note_match", lambda *_: None)  # no news, as on a busy machine
    publisher = Publisher(session, KEY, zenoh.CongestionControl.BLOCK, lambda: None, always=False)
    monkeypatch.undo()
    assert not publisher.needed
    with session.declare_subscriber(KEY):
        publisher.look()
        assert publisher.needed
    publisher.close()


def test_who_publishes_always_needs_no_look(session):
    publisher = Publisher(session, KEY, zenoh.CongestionControl.BLOCK, lambda: None, always=True)
    publisher.look()
    assert publisher.needed
    publisher.close()
