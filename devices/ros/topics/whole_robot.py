"""The topics of all simulated arms together: `/tf`, `/joint_states` and `/robot_description`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from devices.ros.params import GatewayParams
from devices.ros.topics.publications import State, WantedSource
from devices.ros.topics.tf import TF_PERIOD_NS, TransformTree
from hub.participant import signal_in
from schemas.errors import DeviceError
from schemas.ros import JointState
from schemas.vectors import VectorCodec

__all__ = ["inputs_of_all", "periods_between", "robot_description", "whole_robot_sources"]

_PARTS = ("", "jaw/", "hand/", "gripper/")


def whole_robot_sources(params: GatewayParams, states: Mapping[str, State]) -> Mapping[str, WantedSource]:
    """Return the sources of topics of all arms together, by row name; `states`: states by port.

    The authors' simulator (profile `vrep`) has no such topics.
    """
    if params.profile != "dvrk":
        return {}
    return {"tf": TransformTree(params, states), "joint_states": _JointStates(params, states)}


def inputs_of_all(params: GatewayParams) -> frozenset[str]:
    """Return the ports read by the gateway itself: for `/tf`, `/joint_states` and kinematics.

    From these ports the gateway also knows whether the simulation runs.
    """
    poses = ("{}/local/measured_cp", "SUJ/{}/measured_cp", "SUJ/{}/local/measured_cp")
    joints = (f"{{}}/{part}measured_js" for part in _PARTS)
    names = (*poses, *joints)
    return frozenset(name.format(arm) for arm in params.arms.driven_arms for name in names)


def periods_between(name: str, period_ns: int) -> int:
    """Return how many of a gateway's periods lie between two messages of the row `name`."""
    return max(1, round(TF_PERIOD_NS / period_ns)) if name == "tf" else 1


def robot_description(file: Path) -> str:
    """Return the URDF in `file`, with meshes as URIs, because readers do not know the directory.

    Raises DeviceError if `file` is no URDF.
    """
    try:
        robot = ElementTree.fromstring(file.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise DeviceError(
            f"robot_description '{file}' is no URDF: {error}; `trocar model export` writes one"
        ) from error
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        if "://" not in name:
            mesh.set("filename", (file.parent / name).as_uri())
    return ElementTree.tostring(robot, encoding="unicode")


class _JointStates:
    """The joints of all arms and instruments, named `<arm>_<joint>` as in the robot's description."""

    def __init__(self, params: GatewayParams, states: Mapping[str, State]) -> None:
        found = (
            (arm, states.get(f"{arm}/{part}measured_js"))
            for arm in params.arms.driven_arms
            for part in _PARTS
        )
        self._parts = [(arm, state) for arm, state in found if state is not None]
        self._known: list[State] = []
        self._codec: VectorCodec | None = None

    @property
    def present(self) -> bool:
        """Whether any joint is known now."""
        return any(state.present for _, state in self._parts)

    def cdr(self, stamp_ns: int) -> bytes | None:
        """Return all known joints as a JointState; None: no joint is known."""
        known = [(arm, state, value) for arm, state in self._parts if (value := state.value) is not None]
        if not known:
            return None
        states = [state for _, state, _ in known]
        if self._codec is None or states != self._known:
            self._known = states
            names = tuple(f"{arm}_{joint}" for arm, state, _ in known for joint in state.port.names)
            self._codec = VectorCodec(
                signal_in("joint_states", JointState, names=names, fields=("position", "velocity", "effort"))
            )
        rows = [value.reshape(3, -1) for _, _, value in known]  # position, velocity, effort of each arm
        return self._codec.encode(np.concatenate(rows, axis=1).ravel(), stamp_ns)
