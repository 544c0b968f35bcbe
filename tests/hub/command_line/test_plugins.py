import os
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from hub.command_line import plugins

SCALES = """
import typer

app = typer.Typer(help="Weigh things.", no_args_is_help=True)


@app.command()
def weigh(kilograms: float):
    typer.echo(f"{kilograms} kg")


@app.command()
def tare():
    typer.echo("0 kg")


spoilt = typer.Typer()


@spoilt.command()
def odd(thing: "Nothing"):
    pass
"""


@pytest.fixture
def command_line():
    """A command line with commands of its own, to mount others on."""
    app = typer.Typer()
    app.command("check")(lambda: typer.echo("checked"))
    app.command("run")(lambda: typer.echo("done"))
    return app


def run(app, *arguments):
    return CliRunner().invoke(app, list(arguments))


def test_a_sub_app_of_another_package_is_a_command(command_line, install_plugin):
    install_plugin("scales", {"trocar.commands": {"scale": "scales:app"}}, text=SCALES)
    plugins.mount_plugins(command_line)
    assert "Weigh things." in run(command_line, "--help").stdout
    assert run(command_line, "scale", "weigh", "2.5").stdout == "2.5 kg\n"
    assert run(command_line, "check").stdout == "checked\n"


@pytest.mark.parametrize(
    ("value", "cause"),
    [
        ("scales:nothing", "AttributeError"),
        ("no_such_module:app", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("scales:SPEED", "TypeError: expected a typer.Typer, got str"),
        ("scales:spoilt", "NameError: name 'Nothing' is not defined"),
    ],
)
def test_a_broken_one_is_left_out_with_the_cause(command_line, install_plugin, caplog, value, cause):
    install_plugin(
        "scales",
        {"trocar.commands": {"broken": value, "scale": "scales:app"}},
        text=SCALES + "SPEED = 'slow'\n",
    )
    plugins.mount_plugins(command_line)
    (record,) = (record for record in caplog.records if "'broken'" in record.message)
    assert (
        f"command 'broken' of 'scales' ({value}) is left out, it cannot be loaded: {cause}" in record.message
    )
    assert run(command_line, "check").stdout == "checked\n"
    assert run(command_line, "scale", "tare").stdout == "0 kg\n"
    assert run(command_line, "broken").exit_code == 2


def test_a_name_that_is_taken_stays_with_its_owner(command_line, install_plugin, caplog):
    install_plugin("scales", {"trocar.commands": {"check": "scales:app"}}, text=SCALES)
    plugins.mount_plugins(command_line)
    assert (
        "command 'check' of 'scales' (scales:app) is left out: another command has that name" in caplog.text
    )
    assert run(command_line, "check").stdout == "checked\n"


def test_trocar_mounts_them_and_says_on_stderr_what_it_leaves_out(install_plugin, tmp_path):
    install_plugin(
        "scales", {"trocar.commands": {"broken": "scales:nothing", "scale": "scales:app"}}, text=SCALES
    )
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tmp_path / "site_scales"), os.environ.get("PYTHONPATH", "")])
    }
    command = [sys.executable, "-P", "-m", "hub.command_line", "scale", "weigh", "7"]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout == "7.0 kg\n"
    assert "command 'broken' of 'scales' (scales:nothing) is left out" in ran.stderr


def test_one_with_a_single_command_is_that_command(command_line, install_plugin):
    single = SCALES.partition("@app.command()\ndef tare")[0]
    install_plugin("scales", {"trocar.commands": {"scale": "scales:app"}}, text=single)
    plugins.mount_plugins(command_line)
    assert run(command_line, "scale", "2.5").stdout == "2.5 kg\n"


def test_a_plugin_module_can_be_imported_by_itself():
    """Its import of `hub.command_line` mounts no plug-ins, which would include the module itself."""
    code = "import engines.fmu.ssp.export_command, sys; sys.exit('hub.command_line.app' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
