"""Participants that only declare: for tests of the wiring."""

from hub.participant import Device, Stepped
from hub.planning.wiring import make_plan
from schemas.ports import Port
from schemas.scenario import Scenario


class Part(Stepped):
    """A stepped participant with given ports and bonds."""

    ports = bonds = ()

    def __init__(self, name, *ports, bonds=()):
        super().__init__(name, None)
        self.ports, self.bonds = ports, tuple(bonds)

    def configure(self, setup):
        return {}

    def step(self, t, h, inputs):
        return {}

    def state_hash(self):
        return 0

    def close(self):
        pass


class Stylus(Device):
    """A device with given ports."""

    ports = ()

    def __init__(self, name, *ports):
        super().__init__(name, None)
        self.ports = ports

    def open(self, directory):
        pass

    def read(self, t):
        return ()

    def close(self):
        pass


def out(name="out", **rest):
    return Port(name=name, causality="output", **rest)


def into(name="in", **rest):
    return Port(name=name, causality="input", **rest)


def plan_of(*parts, specs=None, **scenario):
    """Return the plan of a scenario with these participants."""
    tree = {"name": "wiring", "step": "1 ms", **scenario}
    tree["participants"] = {part.name: {"kind": "part", **(specs or {}).get(part.name, {})} for part in parts}
    roles = {part.name: "device" if isinstance(part, Device) else "engine" for part in parts}
    return make_plan(Scenario.model_validate(tree), {part.name: part for part in parts}, roles)
