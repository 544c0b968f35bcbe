"""The public names of Trocar, for plug-ins, notebooks and examples.

    import trocar

    summary = trocar.run("palpation", set={"duration": "2 s"}, record="recordings/palpation")
    joints = trocar.Recording(summary.recording)["robot.PSM1/measured_js"]
    joints.time, joints["position"]     # (n,) s of simulated time, (n, 6) rad and m

What is in `__all__` here, in `trocar.messages` (ROS 2 messages), in `trocar.quantities` (parameters with
units), in `trocar.programs` (programs that lead arms), in `trocar.policies` (policies that lead arms), in
`trocar.records` (state with named fields), in `trocar.tasks` (training tasks), in `trocar.haptics` (haptic
devices), in `trocar.testing` (a driver of one participant) and in `trocar.environments` (environments for
Gymnasium; the former name `learning.environments` works in this release) is public. All other modules of the
distribution (`schemas`, `anatomy`, `robots`, `hub`, `engines`, `controllers`, `devices`, `tasks`, `learning`,
`configs`) are private, and may change in any release.
`python -m trocar` is the command line.

Sessions          `run`, `verify`, `fork`, `load_scenario`, `run_in_process`, `SteppedSession`
Leading an arm    `connect`: arms and cameras of a running session, for a program of its own
Results           `Recording`, `Series`, `Reading`, `Summary`, `VerifySummary`; `recover` for a recording
                  cut short; `write_bag` for samples to play
Participants      `Stepped`, `Controller`, `Device`, `Params`, `Setup`, `Port`, `Inputs`, `Outputs`,
                  `Sample`, `Value`, `state_hash`, `restore_arrays`
Ports             `signal_in`, `signal_out`, `event_in`, `event_out`: each returns a `Port`
Power bonds       `BondSide`, `BondPlan`, `ForceSide`, `MotionSide`
Conformance       `check_engine`, `check_device`
Kinematics        `chain`, `inverse`
Errors            `TrocarError`, the root of all errors raised on purpose

Names are imported at first use, so `import trocar` itself takes a few milliseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hub.observation.summary import Summary
    from hub.participant import (
        BondPlan,
        Controller,
        Device,
        ForceSide,
        Inputs,
        MotionSide,
        Outputs,
        Params,
        Sample,
        Setup,
        Stepped,
        Value,
        event_in,
        event_out,
        restore_arrays,
        signal_in,
        signal_out,
        state_hash,
    )
    from hub.recording.recording import Recording
    from hub.recording.recover import recover
    from hub.recording.ros_bag_writer import write_bag
    from hub.recording.series import Series
    from hub.session.reading import Reading
    from hub.session.stepped_session import SteppedSession
    from hub.testing import check_device, check_engine, run_in_process
    from hub.verify import VerifySummary
    from robots.dvrk.arms import chain
    from robots.dvrk.inverse import inverse
    from schemas.errors import TrocarError
    from schemas.ports import BondSide, Port
    from trocar.programs import connect
    from trocar.sessions import fork, load_scenario, run, verify

__all__ = [
    "BondPlan",
    "BondSide",
    "Controller",
    "Device",
    "ForceSide",
    "Inputs",
    "MotionSide",
    "Outputs",
    "Params",
    "Port",
    "Reading",
    "Recording",
    "Sample",
    "Series",
    "Setup",
    "Stepped",
    "SteppedSession",
    "Summary",
    "TrocarError",
    "Value",
    "VerifySummary",
    "chain",
    "check_device",
    "check_engine",
    "connect",
    "event_in",
    "event_out",
    "fork",
    "inverse",
    "load_scenario",
    "recover",
    "restore_arrays",
    "run",
    "run_in_process",
    "signal_in",
    "signal_out",
    "state_hash",
    "verify",
    "write_bag",
]

_MODULES = {
    "hub.observation.summary": ("Summary",),
    "hub.participant": (
        "BondPlan",
        "Controller",
        "Device",
        "ForceSide",
        "Inputs",
        "MotionSide",
        "Outputs",
        "Params",
        "Sample",
        "Setup",
        "Stepped",
        "Value",
        "event_in",
        "event_out",
        "restore_arrays",
        "signal_in",
        "signal_out",
        "state_hash",
    ),
    "hub.recording.ros_bag_writer": ("write_bag",),
    "hub.recording.recording": ("Recording",),
    "hub.recording.recover": ("recover",),
    "hub.recording.series": ("Series",),
    "hub.session.reading": ("Reading",),
    "hub.session.stepped_session": ("SteppedSession",),
    "hub.testing": ("check_device", "check_engine", "run_in_process"),
    "hub.verify": ("VerifySummary",),
    "robots.dvrk.arms": ("chain",),
    "robots.dvrk.inverse": ("inverse",),
    "schemas.errors": ("TrocarError",),
    "schemas.ports": ("BondSide", "Port"),
    "trocar.programs": ("connect",),
    "trocar.sessions": ("fork", "load_scenario", "run", "verify"),
}
_ORIGINS = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a public name at first use (PEP 562)."""
    if name not in _ORIGINS:
        raise AttributeError(f"module 'trocar' has no public name '{name}'; it has {', '.join(__all__)}")
    value = globals()[name] = getattr(import_module(_ORIGINS[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
