"""The authority of a hub, its certificates, and what is said of those that are not valid."""

import os
import stat
import sys
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address

import pytest
from typer.testing import CliRunner

from hub import doctor
from hub.command_line.certs import app
from hub.security import certs, credentials
from hub.security.credentials import Credentials, default_directory, examine, load
from schemas.errors import ConnectError, ScenarioError
from tests.hub.authorities import Authority


@pytest.fixture
def authority(tmp_path):
    return Authority.founded(tmp_path / "own", "hub.example", "10.0.0.1")


def test_the_hubs_certificate_holds_for_its_names(authority):
    seen = examine(authority.hub)
    assert (seen.name, seen.hosts) == ("hub", ("hub.example", "10.0.0.1"))
    assert timedelta(hours=23) < seen.until - datetime.now(UTC) < timedelta(hours=25)


def test_a_participants_certificate_is_one_file(authority, tmp_path):
    authority.issued("touch")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (authority.directory / "touch.pem").rename(elsewhere / "touch.pem")
    assert examine(load("touch", elsewhere)).name == "touch"
    assert load("touch", elsewhere) == load("whatever", elsewhere / "touch.pem")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such modes")
def test_nobody_else_can_read_a_key(authority):
    old = os.umask(0)
    try:
        authority.issued("touch")
    finally:
        os.umask(old)
    assert {stat.S_IMODE(file.stat().st_mode) for file in authority.directory.iterdir()} == {0o600}
    assert stat.S_IMODE(authority.directory.stat().st_mode) == 0o700


def test_an_authority_is_not_replaced(authority):
    before = {file: file.read_bytes() for file in authority.directory.iterdir()}
    with pytest.raises(ScenarioError, match=r"has an authority already.*trocar certs renew"):
        certs.create_authority(authority.directory, ["hub.example"], 1)
    assert before == {file: file.read_bytes() for file in authority.directory.iterdir()}


def test_a_new_certificate_of_the_hub_keeps_its_names_or_gets_others(authority):
    before = authority.hub
    certs.renew(authority.directory, (), 2)
    assert authority.hub != before
    assert examine(authority.hub).hosts == ("hub.example", "10.0.0.1")
    certs.renew(authority.directory, ["::1"], 2)
    assert [ip_address(host) for host in examine(authority.hub).hosts] == [ip_address("::1")]


def test_an_expired_certificate_says_so_and_how_to_mend_it(authority):
    expired = authority.issued("touch", days=-0.01)
    with pytest.raises(
        ConnectError, match=r"touch.pem is not valid: certificate has expired.*trocar certs issue touch"
    ):
        examine(expired)
    certs.renew(authority.directory, (), -0.01)
    with pytest.raises(
        ConnectError, match=r"hub.pem is not valid: certificate has expired.*trocar certs renew"
    ):
        examine(authority.hub)
    with pytest.raises(ConnectError, match=r"trocar certs renew HOST"):
        certs.renew(authority.directory, (), 1)


def test_a_certificate_is_held_against_its_own_authority_key_and_purpose(authority, tmp_path):
    mine, other = authority.issued("touch"), Authority.founded(tmp_path / "other").issued("touch")
    of_another_authority = mine.key, mine.certificate, other.authority
    of_another_key = other.key, mine.certificate, mine.authority
    of_a_hub = authority.hub.key, authority.hub.certificate, mine.authority
    for parts in (of_another_authority, of_another_key, of_a_hub):
        file = tmp_path / "touch.pem"
        file.write_text("".join(parts))
        with pytest.raises(ConnectError, match=r"touch.pem is not valid"):
            examine(Credentials(file, *parts))


@pytest.mark.parametrize("name", ["hub", "ca", "", "two words", "../touch", "a/b", "ü"])
def test_a_name_that_no_participant_can_have_gets_no_certificate(authority, name):
    with pytest.raises(ScenarioError, match="cannot have a certificate"):
        certs.issue(authority.directory, name, 1)


def test_what_is_missing_or_something_else_is_said_with_what_to_do(authority, tmp_path):
    with pytest.raises(
        ConnectError,
        match=r"there is no certificate .*touch.pem.*trocar certs issue touch, on the hub's machine",
    ):
        load("touch", tmp_path)
    with pytest.raises(ConnectError, match=r"there is no certificate .*hub.pem.*trocar certs init"):
        load("hub", tmp_path)
    with pytest.raises(ConnectError, match="has no authority that can be read"):
        certs.issue(tmp_path, "touch", 1)
    with pytest.raises(ConnectError, match="no file of `trocar certs`"):
        load("ca", authority.directory / "ca.pem")
    (tmp_path / "touch.pem").write_bytes(b"\xff\x00")
    with pytest.raises(ConnectError, match="cannot be read"):
        load("touch", tmp_path)


def test_the_names_of_this_machine_are_names_and_addresses():
    names = certs.names_of_this_machine()
    assert "localhost" in names
    assert len(names) == len(set(names))


def test_certificates_are_looked_for_in_the_users_settings(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setenv("APPDATA", str(tmp_path))
    if sys.platform != "darwin":
        assert default_directory() == tmp_path / "trocar" / "certs"


def test_the_command_line_makes_and_shows_them(tmp_path):
    place = ["--dir", str(tmp_path / "certs")]
    run = CliRunner().invoke
    assert "no certificate in" in run(app, ["show", *place]).output
    assert run(app, ["init", "hub.example", *place]).exit_code == 0
    assert run(app, ["issue", "touch", *place]).exit_code == 0
    assert run(app, ["issue", "observer", "--days", "2", *place]).exit_code == 0
    assert run(app, ["issue", "touch", "--days", "0", *place]).exit_code == 2  # and the one that works stays
    assert run(app, ["renew", *place]).exit_code == 0
    shown = run(app, ["show", *place]).output
    for word in (
        "hub.example",
        "participant touch",
        "(29 days)",
        "(1 days)",
        "(396 days)",
        "observers of the status",
    ):
        assert word in shown
    certs.issue(tmp_path / "certs", "touch", -0.01)
    assert "invalid" in run(app, ["show", *place]).output


def test_a_revoked_certificate_is_followed_by_one_with_another_common_name(authority):
    assert examine(authority.issued("touch")).common_name == "touch"
    assert certs.revoke(authority.directory, "touch") == "touch"
    again = examine(authority.issued("touch"))
    assert (again.name, again.common_name) == ("touch", "touch.2")
    assert certs.revoke(authority.directory, "touch") == "touch.2"
    assert examine(authority.issued("touch")).common_name == "touch.3"
    assert examine(authority.issued("head")).common_name == "head"


def test_only_what_an_authority_can_issue_is_revoked(authority, tmp_path):
    with pytest.raises(ScenarioError, match=r"hub's certificate cannot be revoked.*trocar certs init"):
        certs.revoke(authority.directory, "hub")
    with pytest.raises(ScenarioError, match="cannot have a certificate"):
        certs.revoke(authority.directory, "touch.2")
    with pytest.raises(ConnectError, match="has no authority that can be read"):
        certs.revoke(tmp_path, "touch")


def test_the_command_line_revokes(authority):
    place = ["--dir", str(authority.directory)]
    run = CliRunner().invoke
    authority.issued("touch")
    assert run(app, ["revoke", "touch", *place]).exit_code == 0
    assert "revoked" in run(app, ["show", *place]).output
    assert run(app, ["issue", "touch", *place]).exit_code == 0
    assert "revoked" not in run(app, ["show", *place]).output


@pytest.mark.long
def test_doctor_tells_until_when_they_are_valid(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "_run_package_checks", lambda: iter(()))
    monkeypatch.setattr(credentials, "default_directory", lambda: tmp_path / "certs")
    (nothing,) = (finding for finding in doctor.examine() if finding.area == "network")
    assert (nothing.works, nothing.name) == (False, "certificates")
    own = Authority.founded(tmp_path / "certs")
    own.issued("touch", days=-0.01)
    found = {finding.name: finding for finding in doctor.examine() if finding.area == "network"}
    assert found["hub"].works
    assert "valid until" in found["hub"].detail
    assert not found["touch"].works
    assert found["touch"].remedy == "trocar certs issue touch"
