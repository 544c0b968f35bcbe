"""The interface of engines, controllers and devices, without processes and Zenoh."""

from hub.participant.base import Outputs, Params, Participant, Value
from hub.participant.bond import ForceSide, MotionSide
from hub.participant.contact import Surface, TissueParams, Tool, ToolParams
from hub.participant.controller import Controller
from hub.participant.device import Device, Sample, VectorSample
from hub.participant.inputs import Inputs
from hub.participant.ports import SignalFields, event_in, event_out, signal_in, signal_out, tunable_in
from hub.participant.saved_parts import join_saved, split_saved
from hub.participant.state import Record, array, choice, flag, integer, number, restore_arrays, state_hash
from hub.participant.stepped import BondPlan, Correction, Leaper, Setup, Stepped
from hub.participant.tunables import Tunables

__all__ = [
    "BondPlan",
    "Controller",
    "Correction",
    "Device",
    "ForceSide",
    "Inputs",
    "Leaper",
    "MotionSide",
    "Outputs",
    "Params",
    "Participant",
    "Record",
    "Sample",
    "Setup",
    "SignalFields",
    "Stepped",
    "Surface",
    "TissueParams",
    "Tool",
    "ToolParams",
    "Tunables",
    "Value",
    "VectorSample",
    "array",
    "choice",
    "event_in",
    "event_out",
    "flag",
    "integer",
    "join_saved",
    "number",
    "restore_arrays",
    "signal_in",
    "signal_out",
    "split_saved",
    "state_hash",
    "tunable_in",
]
