"""Policies that lead arms: ask one in a loop of your own, or make one for a session.

    from trocar.policies import Contract, Observation, Terms, open_policy

    policy = open_policy("openpi://localhost:8000", terms, timeout_s=10.0)
    policy.reset(0)
    rows = policy.act(Observation(1, {"endoscope/left": picture}, state, "pick up the needle"))

`open_policy` has the backends of the kind `policy`, without a session. `Contract` states what a policy
sees and does; `Terms` has all names, units and frames for the arms of a scene, and checks a policy's own
statement. `ACTIONS` are the layouts of actions: each decodes rows to goals and encodes goals to rows;
`encode_state` makes a state of `ArmReading`. `check_actions` is the check of an answer.
docs/how-to/policies.md.
"""

from devices.policies.policy import Observation, Policy, check_actions, open_policy
from robots.policies.actions import ACTIONS, ActionLayout
from robots.policies.contract import CameraContract, Contract
from robots.policies.fields import Field, Group
from robots.policies.states import ArmReading, encode_state
from robots.policies.terms import Terms

__all__ = [
    "ACTIONS",
    "ActionLayout",
    "ArmReading",
    "CameraContract",
    "Contract",
    "Field",
    "Group",
    "Observation",
    "Policy",
    "Terms",
    "check_actions",
    "encode_state",
    "open_policy",
]
