"""What is made of the lines of Zenoh's log; that they are still as they were, the tests of the gate itself
show.
"""

import logging

import pytest

from hub.security.gate_log import GateLog

ZENOH = (
    "2026-11-21T18:48:20.1Z \x1b[33m{level}\x1b[0m  rx-1 ThreadId({thread}) \x1b[2mzenoh{module}\x1b[0m:"
    " {text}"
)
KINDS = (
    "Query",
    "Reply",
    "Put",
    "Delete",
    "Declare/Undeclare Subscriber",
    "Declare/Undeclare Queryable",
    "Declare/Undeclare Liveliness Token",
)
KINDS += ("Liveliness Query", "Declare Liveliness Subscriber")


def rule(text, thread=1):
    return ZENOH.format(
        level="TRACE", thread=thread, module="::net::routing::interceptor::access_control", text=text
    )


def tls(text, level="WARN"):
    return ZENOH.format(level=level, thread=4, module="_link_tls::unicast", text=text)


def came(name, address="10.0.0.2:40000"):
    return tls(f"Accepted TLS connection on 10.0.0.1:7447: {address}. Common Name: {name}.", "DEBUG")


def verdict(deed, key, *, may=False, flow="ingress", name="touch", thread=1):
    subject = f"abc1 on Interface(eth0)+CertCommonName({name})+Transport(Tls)+abc1"
    return rule(f"{subject} is {'' if may else 'un'}authorized to {deed} ({flow}) on {key}", thread)


def named(key, allowed=(), thread=1):
    """What Zenoh says when somebody names a key: its verdicts on everything that could be done with it."""
    lines = []
    for flow in ("ingress", "egress"):
        lines.append(rule(f"ACL ({flow}): caching permissions for `{key}` ...", thread))
        lines += [verdict(kind, key, may=(flow, kind) in allowed, flow=flow, thread=thread) for kind in KINDS]
    return lines


def read(*lines, known=("touch",)):
    log = GateLog(known)
    return [told for line in lines for told in log.read(f"{line}\n")]


def test_who_connects_is_told_with_name_and_address():
    assert read(came("touch")) == [(logging.INFO, "'touch' connects from 10.0.0.2:40000")]
    ((level, message),) = read(came("nobody"))
    assert level == logging.WARNING
    assert "no remote participant of this session has that name" in message


@pytest.mark.parametrize(
    ("zenoh", "ours"),
    [
        (
            "invalid peer certificate: UnknownIssuer. Hint: increase the system open file limit.",
            "its certificate is of another authority",
        ),
        ("peer sent no certificates. Hint: increase the system open file limit.", "it shows no certificate"),
        ("something new. Hint: increase the system open file limit.", "something new"),
    ],
)
def test_why_a_connection_was_refused_is_said_in_our_words_if_we_have_them(zenoh, ours):
    assert read(tls(zenoh)) == [(logging.WARNING, f"refused a connection: {ours}")]


def test_a_refusal_is_told_once_in_a_connection():
    lines = [came("touch"), *[verdict("Put", "trocar/s/hub/grant")] * 3]
    cached = rule("Using cached result: abc1 is unauthorized to Put (ingress) on trocar/s/hub/grant")
    told = [message for _, message in read(*lines, cached)]
    assert told == [
        "'touch' connects from 10.0.0.2:40000",
        "refused to 'touch' at 10.0.0.2:40000: to put on trocar/s/hub/grant",
    ]
    assert len(read(*lines, *lines)) == 4


def test_what_is_allowed_or_kept_from_somebody_is_not_told():
    assert read(came("touch"), verdict("Put", "a", may=True), verdict("Put", "a", flow="egress"))[1:] == []


def test_to_name_a_key_of_ones_own_is_no_try():
    for flow in ("ingress", "egress"):
        assert (
            read(
                came("touch"),
                *named("trocar/s/device/touch/out/pose", [(flow, "Put")]),
                verdict("Put", "b", may=True),
            )[1:]
            == []
        )


def test_to_name_a_key_of_others_is_one():
    told = [message for _, message in read(came("touch"), *named("trocar/s/device/head/out"))[1:]]
    assert told == [
        "refused to 'touch' at 10.0.0.2:40000: to publish or receive anything on trocar/s/device/head/out"
    ]


def test_threads_do_not_mix():
    own = named("own", [("ingress", "Put")], thread=1)
    others = named("others", thread=2)
    lines = [line for pair in zip(own, others, strict=True) for line in pair]
    assert [message for _, message in read(came("touch"), *lines)[1:]] == [
        "refused to 'touch' at 10.0.0.2:40000: to publish or receive anything on others"
    ]


def test_a_flood_of_refusals_is_not_told_to_its_end():
    told = read(came("touch"), *(verdict("Put", f"key/{i}") for i in range(1000)))[1:]
    assert len(told) == 21
    assert told[-1][1].endswith("further refusals are not reported")


def test_a_key_gives_no_orders_to_a_terminal():
    ((_, message),) = read(came("touch"), verdict("Put", "a\x1b[2Jb\x07"))[1:]
    assert message.endswith("to put on a[2Jb")


@pytest.mark.parametrize("line", ["", "nonsense", "ThreadId(1) is unauthorized to", "2026 INFO zenoh: hello"])
def test_any_other_line_is_passed_over(line):
    assert read(line) == []


def test_a_connection_that_ended_was_let_in_or_not():
    log = GateLog(["touch"])
    list(log.read(came("touch")))
    assert list(log.closed("10.0.0.2:40000")) == []
    assert list(log.closed("10.0.0.2:40001")) == [
        (logging.WARNING, "the connection from 10.0.0.2:40001 was not accepted")
    ]
