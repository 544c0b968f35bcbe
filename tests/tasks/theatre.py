"""Tissue of kind fem, instruments led by a test, and the cholecystectomy task, in steps of a session."""

from pathlib import Path

import numpy as np

from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from hub.participant import BondPlan, Inputs, Setup
from hub.testing import Driver
from schemas.codec import encode
from schemas.ros import EmptyMessage
from tasks.cholecystectomy.outcome import FAILURES
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.task import CholecystectomyTask

MS = 1_000_000
TASK_MS = 10
DOWN = (1.0, 0.0, 0.0, 0.0)
"""A tip that looks down, across the tubes."""
TUBE = {
    "tube": {"length": "30 mm", "diameter": "4 mm", "wall": "1 mm"},
    "nodes": 200,
    "young_modulus": "200 kPa",
    "cutting": {"toughness": "3 J/m^2"},
    "lumen": {"pressure": "78 mmHg", "supply": ["right"]},
}
"""Its left end, at x = -15 mm, is at the gallbladder."""
BILE = {"lumen": {"liquid": "bile", "pressure": "10 mmHg", "supply": ["left", "right"]}}
HEIGHTS = {"cystic_duct": 0.0, "cystic_artery": 0.03, "common_bile_duct": 0.06, "gallbladder": 0.09}
"""Height of the middle of each tube, m."""
CLIPS = {"spheres": 2, "radius": "1 mm", "clip": {"diameters": ["3 mm", "7 mm"]}}
BLADE = {"spheres": 2, "radius": "1 mm", "blades": [[0, 1]]}
GRASPER = {"spheres": 2, "radius": "1.5 mm", "grasp": {}}
HOOK = {"spheres": 1, "radius": "1 mm", "energy": {"power": "40 W"}}
FAR = 0.3


def tube(organ):
    bile = BILE if organ in ("cystic_duct", "common_bile_duct", "gallbladder") else {}
    return TUBE | bile | {"position": [0.0, 0.0, HEIGHTS[organ]]}


class Theatre:
    """Organs by name (a tube each, or as stated) and probes by the name of an arm."""

    def __init__(self, organs, probes, **more):
        given = organs if isinstance(organs, dict) else {organ: tube(organ) for organ in organs}
        params = FemParams.model_validate(
            {"organs": given, "probes": probes, "gravity": 0.0, "node_period": "10 ms"} | more
        )
        self.engine, self.t = FemEngine("tissue", params), 0
        bonds = {name: BondPlan(prediction="velocity", mean=True) for name in probes}
        self.outputs = dict(self.engine.configure(Setup(MS, Path(), bonds)))
        self.at = {name: np.full((probe["spheres"], 3), FAR) for name, probe in probes.items()}
        self.values, self.commands = {}, {}
        for name, centres in self.at.items():
            self.values |= {
                f"{name}/position": centres.reshape(-1),
                f"{name}/velocity": np.zeros(centres.size),
            }
            if probes[name].get("energy"):
                self.values[f"{name}/energy"] = np.zeros(1)
        self.inputs = Inputs(self.values, events=self.commands)
        arms = {name: {"position": [0.0, 0.0, 0.2]} for name in ("PSM1", "PSM2", "PSM3")}
        self.task = CholecystectomyTask("task", CholecystectomyParams.model_validate({"arms": arms}))
        self.known = {port.name: port for port in self.task.ports if port.causality == "input"}
        tips = {f"{arm}/measured_cp": [FAR * i, 0.0, 0.0, *DOWN] for i, arm in enumerate(arms)}
        self.driver = Driver(self.task, period_ns=TASK_MS * MS, inputs=self._signals() | tips)
        self.task._seen.connect({name for name in self.known if name.removeprefix("tissue/") in self.outputs})
        for arm in self.task._seen.arms:
            arm.has_energy = f"{arm.name}/energy" in self.values
            arm.can_exchange = True
        self.tissue, self.said = [], []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.engine.close()

    def _signals(self):
        signals = (port for port in self.known.values() if port.variability == "signal")
        found = {
            port.name: self.outputs[port.name.removeprefix("tissue/")]
            for port in signals
            if port.name.removeprefix("tissue/") in self.outputs
        }
        return found | {name: self.values[name] for name in self.known if name in self.values}

    def wait(self, seconds):
        return self.lead(None, None, seconds)

    def lead(self, name, target, seconds):
        """Lead the spheres of a probe to places (m) on straight ways at constant speed; None: rest."""
        steps = round(1e3 * seconds)
        if name is not None:
            way = np.asarray(target) - self.at[name]
            self.values[f"{name}/velocity"][:] = (way / seconds).ravel()
        for _ in range(steps):
            if name is not None:
                self.at[name] += way / steps
            self._step_tissue()
            if not self.t % (TASK_MS * MS):
                self._step_task()
        if name is not None:
            self.values[f"{name}/velocity"][:] = 0.0
        return self

    def _step_tissue(self):
        self.outputs |= self.engine.step(self.t, MS, self.inputs)
        self.t += MS
        self.commands.clear()
        for name, value in self.outputs.items():
            if isinstance(value, tuple) and value and f"tissue/{name}" in self.known:
                self.driver.send(f"tissue/{name}", *value)
                if not name.endswith("/tube"):
                    self.tissue += [(one.kind if hasattr(one, "kind") else one.event) for one in value]

    def _step_task(self):
        for name, value in self._signals().items():
            self.driver.set(name, value)
        self.driver.step()
        self.said += [(one.event, one.place, one.arm) for one in self.driver.sent.get("events", ())]

    def put(self, name, centres):
        self.at[name][:] = centres
        return self

    def clip(self, organ, *places, aside=0.0):
        """Close clips on a tube at distances from its left end, m."""
        for along in places:
            z, x = HEIGHTS[organ], along - 0.015
            self.put("PSM1", [[x, aside, z - 3e-3], [x, aside, z + 3e-3]]).wait(0.01)
            self.commands["PSM1/clip"] = (EmptyMessage(),)
            self.wait(0.01).put("PSM1", FAR).wait(0.08)
        return self

    def cut(self, organ, along, reach=1.0):
        """Draw the blade through a tube at a distance from its left end, m; `reach`: share of its height."""
        z, x = HEIGHTS[organ], along - 0.015
        low = z + (0.5 - reach) * 0.006
        self.put("PSM3", [[x, -4e-3, low], [x, -4e-3, z + 4e-3]])
        self.lead("PSM3", [[x, 4e-3, low], [x, 4e-3, z + 4e-3]], 0.3)
        return self.put("PSM3", FAR).wait(0.7)

    def number(self, port):
        return float(self.outputs[port][0])

    @property
    def card(self):
        card = self.task.card(self.driver.time_ns)
        assert encode(card)
        values = [*card.metrics, *(value for rules in card.rules for value in rules.values)]
        assert all(np.isfinite(value.value) for value in values)
        return card

    def metric(self, name):
        value = {one.name: one for one in self.card.metrics}[name]
        return value.reason or value.value

    @property
    def failure(self):
        number = int(self.driver["failure"][0])
        return FAILURES[number - 1] if number else ""

    @property
    def kinds(self):
        return [kind for kind, _, _ in self.said]
