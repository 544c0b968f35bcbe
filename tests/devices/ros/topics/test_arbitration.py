"""Which of several programs leads an arm."""

from devices.ros.topics.arbitration import CommandArbiter

UNIDENTIFIED = "publisher 00"


def test_another_program_waits_until_the_first_has_left():
    names = {"/one": "/one", "/two": "/two"}
    arbiter = CommandArbiter(names.get)
    assert arbiter.refusal("/one") is None
    assert arbiter.refusal("/two").startswith("/two may not move the arm while /one commands it")
    del names["/one"]
    assert arbiter.refusal("/two") is None


def test_the_arm_stays_with_a_program_that_has_left_until_its_move_ends():
    arbiter = CommandArbiter({}.get)
    assert arbiter.refusal("/one") is None
    arbiter.busy = True
    assert arbiter.refusal("/two") is not None
    arbiter.busy = False
    assert arbiter.refusal("/two") is None


def test_a_program_keeps_the_arm_when_its_name_becomes_known():
    names = {UNIDENTIFIED: "/one", "/one": "/one"}
    arbiter = CommandArbiter(names.get)
    assert arbiter.refusal(UNIDENTIFIED) is None
    assert arbiter.refusal("/one") is None
    assert arbiter.refusal("/two") is not None


def test_a_program_without_a_name_leaves_too():
    arbiter = CommandArbiter({}.get)
    assert arbiter.refusal(UNIDENTIFIED) is None
    assert arbiter.refusal("/two") is None
