"""Who is in the graph, and who has sent a message."""

from devices.ros.transport import Client
from devices.ros.zenoh.graph import Graph, gid_of, unidentified
from devices.ros.zenoh.layout import VOLATILE, GraphToken

OURS, ONE, OTHER = "aaaa", "bbbb", "cccc"
COMMAND, STATE = "/PSM1/servo_jp", "/PSM1/measured_js"


def node(session, name="/console"):
    return GraphToken(session, 0, "NN", name).key(0)


def entity(session, topic, kind="MP", number=1, name="/console"):
    return GraphToken(
        session, number, kind, name, topic, "sensor_msgs/msg/JointState", "RIHS01_0", VOLATILE
    ).key(0)


def graph(*tokens):
    it = Graph(OURS)
    for token in tokens:
        it.add(token)
    return it


def test_programs_are_known_by_the_topics_they_publish_or_subscribe_to():
    it = graph(
        node(OURS, "/dvrk"),
        entity(OURS, STATE, name="/dvrk"),
        node(ONE),
        entity(ONE, STATE, "MS"),
        node(OTHER, "/rviz"),
        entity(OTHER, "/other"),
    )
    assert it.clients({COMMAND, STATE}) == (Client("/console", ONE),)


def test_the_first_token_of_a_program_makes_it_a_newcomer():
    it = graph(node(OURS, "/dvrk"))
    assert it.add(node(ONE))
    assert not it.add(entity(ONE, STATE))
    assert not it.add(entity(OURS, STATE))
    assert it.add(entity(OTHER, STATE))


def test_two_programs_of_one_name_have_different_ones():
    it = graph(node(ONE), entity(ONE, STATE), node(OTHER), entity(OTHER, STATE))
    assert [client.name for client in it.clients({STATE})] == ["/console", "/console (cccc)"]


def test_a_program_that_comes_back_has_its_name_again():
    it = graph(node(ONE), entity(ONE, STATE))
    it.remove(entity(ONE, STATE))
    assert it.clients({STATE}) == ()
    it.remove(node(ONE))
    it.add(node(OTHER))
    it.add(entity(OTHER, STATE))
    assert it.clients({STATE}) == (Client("/console", OTHER),)


def test_a_publisher_is_known_by_the_id_that_is_made_of_its_token():
    it = graph(entity(ONE, COMMAND), entity(OTHER, COMMAND, name="/second"))
    assert it.sender(COMMAND, gid_of(entity(OTHER, COMMAND, name="/second"))) == "/second"
    assert it.sender(COMMAND, gid_of(entity(ONE, COMMAND))) == "/console"


def test_one_program_has_one_name_on_all_topics():
    it = graph(entity(ONE, COMMAND, name="/first"), entity(ONE, STATE, number=2, name="/second"))
    assert it.sender(COMMAND, b"0" * 16) == it.sender(STATE, b"1" * 16) == "/first"


def test_a_publisher_with_an_id_of_its_own_is_known_as_the_only_one_left():
    it = graph(entity(ONE, COMMAND))
    assert it.sender(COMMAND, b"0" * 16) == "/console"
    it.add(entity(OTHER, COMMAND, name="/second"))
    assert it.sender(COMMAND, b"0" * 16) == "/console"
    assert it.sender(COMMAND, b"1" * 16) == "/second"


def test_two_of_them_that_nothing_tells_apart_go_by_their_ids():
    it = graph(entity(ONE, COMMAND), entity(OTHER, COMMAND, name="/second"))
    assert it.sender(COMMAND, b"0" * 16) is None
    assert it.present_name(unidentified(b"0" * 16)) == unidentified(b"0" * 16)
    assert unidentified(b"1" * 16) != unidentified(b"0" * 16)


def test_the_sender_of_a_program_that_has_gone_is_forgotten():
    it = graph(entity(ONE, COMMAND))
    assert it.sender(COMMAND, b"0" * 16) == "/console"
    it.remove(entity(ONE, COMMAND))
    assert it.sender(COMMAND, b"0" * 16) is None


def test_a_message_may_come_before_the_token_of_its_publisher():
    it, token = graph(), entity(ONE, COMMAND)
    early = unidentified(gid_of(token))
    assert it.sender(COMMAND, gid_of(token)) is None
    assert it.present_name(early) == early
    it.add(token)
    assert it.present_name(early) == it.present_name("/console") == "/console"
    assert not it.has_left(gid_of(token))
    it.remove(token)
    assert it.has_left(gid_of(token))
    assert it.present_name(early) is None
    assert it.present_name("/console") is None


def test_a_publisher_with_an_id_of_its_own_is_identified_by_its_next_message():
    it, early = graph(), unidentified(b"0" * 16)
    it.add(entity(ONE, COMMAND))
    assert it.present_name(early) == early
    assert it.sender(COMMAND, b"0" * 16) == it.present_name(early) == "/console"
