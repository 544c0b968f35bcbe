import pytest

from hub.planning import registry
from schemas.errors import MissingExtraError, ScenarioError


def test_own_kinds_are_found_with_their_roles():
    kinds = registry.kinds()
    assert {name: kinds[name].role for name in ("mujoco", "bullet", "fmu", "teleoperation", "scripted")} == {
        "mujoco": "engine",
        "bullet": "engine",
        "fmu": "engine",
        "teleoperation": "controller",
        "scripted": "device",
    }
    assert registry.broken_kinds() == {}


def test_a_plugin_is_loaded_by_name(pendulum):
    kind = registry.kinds()["pendulum"]
    assert (kind.role, kind.distribution) == ("engine", "swing")
    assert registry.load("pendulum").__name__ == "Pendulum"


def test_an_unknown_kind_gets_a_suggestion():
    with pytest.raises(ScenarioError, match=r"unknown kind 'mujocco'. Did you mean 'mujoco'\?"):
        registry.load("mujocco")


def test_a_broken_plugin_is_listed_and_does_not_stop_the_rest(install_plugin):
    install_plugin(
        "wrecked", {"trocar.engines": {"wreck": "wrecked:Wreck"}}, text="import no_such_module_anywhere"
    )
    assert "'no_such_module_anywhere'" in registry.broken_kinds()["wreck"]
    assert registry.load("scripted").__name__ == "ScriptedDevice"


def test_a_kind_of_the_wrong_role_is_refused(install_plugin):
    install_plugin("swing", {"trocar.devices": {"pendulum": "swing:Pendulum"}})
    with pytest.raises(ScenarioError, match="swing:Pendulum is no subclass of Device"):
        registry.load("pendulum")


def test_two_distributions_with_the_same_kind_are_both_named(install_plugin, pendulum):
    install_plugin("sway", {"trocar.controllers": {"pendulum": "sway:Pendulum"}})
    with pytest.raises(ScenarioError, match="both 'swing' and 'sway' have a kind 'pendulum'"):
        registry.kinds()


def test_a_kind_with_an_extra_of_its_name_needs_it(install_plugin):
    requires = ("numpy", "no-such-package>=3 ; extra == 'pendulum'", "numpy ; extra == 'pendulum'")
    install_plugin(
        "swing", {"trocar.engines": {"pendulum": "swing:Pendulum"}}, requires=requires, extras=("pendulum",)
    )
    with pytest.raises(
        MissingExtraError,
        match=r"engine 'pendulum' needs the package 'no-such-package>=3'.*pip install 'swing\[pendulum\]'",
    ):
        registry.require_extra("pendulum")


def test_an_extra_that_is_the_sum_of_others(install_plugin):
    requires = (
        "no-such-package ; extra == 'one'",
        "swing[one,two] ; extra == 'both'",
        "numpy ; extra == 'two'",
    )
    install_plugin(
        "swing",
        {"trocar.engines": {"pendulum": "swing:Pendulum"}},
        requires=requires,
        extras=("one", "two", "both"),
    )
    dist = registry.kinds()["pendulum"].entry.dist
    assert dist is not None
    assert registry.missing_packages(dist, "both") == ["no-such-package"]
    assert [text.split()[0] for text in registry.installed_packages(dist, "both")] == ["numpy"]
