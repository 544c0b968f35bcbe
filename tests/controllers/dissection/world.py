"""The dissection routine without physics: tips go where they are sent, ties near a hook with power part."""

import numpy as np

from controllers.dissection.controller import Dissection
from controllers.dissection.step import Step
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots.dvrk.inverse import inverse
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.ros import Header, StringMessage
from schemas.trocar_msgs import SoftBodyState, TiedPlaces

__all__ = ["Triangle", "World"]

PERIOD = 20_000_000
HEADER = Header(frame_id="world")
HEAT = 4.0
"""Heat that parts a tie, J."""
REACH = 4e-3
"""Distance from the hook within which a tie is heated, m."""
SLACK, STIFFNESS = 8e-3, 40.0
"""Way of the grasper before the gallbladder is taut (m), and pull over the way beyond (N/m)."""


def grid(*ranges):
    return np.stack(np.meshgrid(*[np.linspace(*ends) for ends in ranges]), axis=-1).reshape(-1, 3)


class World:
    """A gallbladder on its bed, as in the scenario gallbladder-bed."""

    scenario = "gallbladder-bed"

    def __init__(self, *settings):
        given = load(self.scenario, [f"participants.routine.{setting}" for setting in settings])
        self.routine = Dissection("routine", given.params["routine"])
        self.routine.configure(Setup(PERIOD, "."))
        self.hands = {hand.arm: hand for hand in (self.routine._hook, self.routine._grasper)}
        arms = given.params["routine"].arms.present_arms
        self.joints = {arm: np.array(arms[arm].start) for arm in self.hands}
        self.ties = grid((-0.026, -0.014, 2), (0.022, 0.066, 5), (-0.004, -0.004, 1))
        self.heats = np.zeros(len(self.ties))
        body = grid((-0.030, -0.010, 5), (0.018, 0.075, 12), (-0.002, 0.018, 5))
        neck = grid((-0.012, -0.004, 3), (0.0, 0.016, 5), (0.0, 0.008, 3))
        self.nodes = np.concatenate([body, neck])
        self.liver = grid((-0.05, 0.02, 8), (0.0, 0.08, 8), (-0.012, -0.012, 1))
        self.held, self.grip, self.jaw, self.delivered = False, None, 0.0, 0.0
        self.misses = self.slips = 0
        """How often the next grasps fail, and how often a held gallbladder slips away."""
        self.stubborn = np.zeros(len(self.ties), np.bool_)
        """Ties that heat does not part."""
        self.refused, self.said, self.steps, self.powers, self.t = [], [], [], [], 0

    @property
    def state(self):
        return self.routine._dissector.state

    def tip(self, arm):
        """Pose of a tip in the world, shape (4, 4)."""
        hand = self.hands[arm]
        return hand.base @ hand.chain.forward(self.joints[arm])

    def step(self):
        """Advance by a period."""
        pull = np.zeros(3)
        if self.held:
            way = self.tip("PSM2")[:3, 3] - self.grip
            length = float(np.linalg.norm(way))
            pull = (
                STIFFNESS * max(0.0, length - SLACK - 2e-3 * (10 - len(self.ties))) * way / max(length, 1e-9)
            )
        values = {
            "PSM2/held": np.array([float(self.held)]),
            "PSM2/pull": pull,
            "PSM1/delivered": np.array([self.delivered]),
            "PSM2/jaw/measured_js": np.array([self.jaw, 0.0, 0.0]),
            "cystic_plate/lower_third": np.array([1.0 - (self.ties[:, 1] < 0.035).sum() / 4.0]),
            "cystic_plate/ties": TiedPlaces(header=HEADER, attachment="", points_m=self.ties.ravel()),
        }
        values |= self._more()
        for port in self.routine.ports:
            if port.causality == "input" and port.start == ():
                values.setdefault(port.name, None)
        for organ, nodes in (("gallbladder", self.nodes), ("liver", self.liver)):
            values[f"{organ}/nodes"] = SoftBodyState(
                header=HEADER, body="", nodes_m=np.float32(nodes).ravel()
            )
        for arm, hand in self.hands.items():
            values[f"{arm}/local/measured_cp"] = matrix_to_pose(hand.chain.forward(self.joints[arm]))
            values[f"{arm}/measured_js"] = np.concatenate([self.joints[arm], np.zeros(12)])
        events = {f"{arm}/error": (StringMessage(data=text),) for arm, text in self.refused}
        self.refused = []
        out = self.routine.step(self.t, PERIOD, Inputs(values, events=events))
        self.t += PERIOD
        self.said += [message.data for message in out["status"]]
        if not self.steps or self.steps[-1] is not self.state.step:
            self.steps.append(self.state.step)
        for arm in self.hands:
            self._follow(arm, out)
        self.powers.append(float(out["PSM1/energy"][0]))
        self._burn(self.powers[-1])
        return out

    def run(self, seconds):
        """Advance until the routine has ended."""
        for _ in range(round(1e9 * seconds / PERIOD)):
            self.step()
            if self.state.done or self.state.failed:
                break
        return self

    def _more(self):
        """Return what a scene has besides, by port."""
        return {}

    def _follow(self, arm, out):
        hand = self.hands[arm]
        for message in out[f"{arm}/servo_cp"]:
            pose, turn = message.pose.position, message.pose.orientation
            goal = pose_to_matrix(np.array([pose.x, pose.y, pose.z, turn.x, turn.y, turn.z, turn.w]))
            try:
                self.joints[arm] = inverse(hand.chain, goal, self.joints[arm])
            except MotionError as error:
                self.refused.append((arm, str(error)))
        if arm == "PSM2":
            for message in out["PSM2/jaw/move_jp"]:
                closes = float(message.position[0]) < self.jaw
                self.jaw = float(message.position[0])
                self._grasp(closes)

    def _grasp(self, closes):
        tip = self.tip("PSM2")
        ends = tip[:3, 3] + 0.012 * tip[:3, 2]
        near = closes and np.linalg.norm(self.nodes - ends, axis=1).min() < 5e-3
        self.held, self.grip = bool(near and not self.misses), tip[:3, 3]
        self.misses = max(0, self.misses - closes)

    def _burn(self, power):
        apart = np.linalg.norm(self.ties - self.hands["PSM1"].bare_end, axis=1)
        near = apart < REACH
        if power and near.any():
            self.delivered += 0.5 * power * PERIOD * 1e-9
            self.heats[near & ~self.stubborn] += 0.5 * power * PERIOD * 1e-9
            kept = self.heats < HEAT
            self.ties, self.heats, self.stubborn = self.ties[kept], self.heats[kept], self.stubborn[kept]


class Triangle(World):
    """The scenario calot-dissection: fat lies on gallbladder and duct, beside the common duct."""

    scenario = "calot-dissection"
    area = 4e-6
    """Area of a tie of the fat, m^2."""

    def __init__(self, *settings):
        super().__init__(*settings)
        self.fat = grid((-0.010, 0.012, 6), (-0.006, 0.006, 4), (0.004, 0.004, 1))
        self.sheet = grid((-0.014, 0.016, 13), (-0.018, 0.014, 13), (0.0045, 0.0045, 1))
        self.common_duct = grid((0.022, 0.026, 3), (-0.04, 0.04, 15), (-0.008, 0.0, 3))
        self.glued = np.zeros(len(self.fat), np.bool_)
        """Ties of the fat that neither pull nor heat parts."""
        self.weak = np.zeros(len(self.fat), np.bool_)
        """Ties of the fat that part when they are lifted."""
        self.firm = np.zeros(len(self.fat), np.bool_)
        """Ties of the fat that the grasper does not strip."""
        self.fold = None
        """Place where the grasper holds a fold, m."""
        self.folds = 0
        """How many folds have been held."""
        self.lifted_from = np.full(len(self.fat), np.nan)
        self.burns = []
        """Places of the hook with power at the fat, m."""

    def _more(self):
        areas = np.full(len(self.fat), self.area)
        tied = TiedPlaces(header=HEADER, attachment="", points_m=self.fat.ravel(), areas_m2=areas)
        nodes = {"fat": self.sheet, "common_bile_duct": self.common_duct}
        nodes |= dict.fromkeys(("cystic_duct", "cystic_artery", "hepatic_artery"), self.common_duct)
        return {"fat_cystic_duct/ties": tied} | {
            f"{organ}/nodes": SoftBodyState(header=HEADER, body="", nodes_m=np.float32(points).ravel())
            for organ, points in nodes.items()
        }

    def _grasp(self, closes):
        if self.state.step is not Step.PINCH and self.fold is None:
            super()._grasp(closes)
            return
        tip = self.tip("PSM2")
        ends = tip[:3, 3] + self.hands["PSM2"].jaw.length * tip[:3, 2]
        self.held = bool(closes and np.linalg.norm(self.sheet - ends, axis=1).min() < 5e-3)
        self.fold, self.grip = ends if self.held else None, tip[:3, 3]
        self.folds += self.held

    def _strip(self):
        if self.fold is not None and np.linalg.norm(self.tip("PSM2")[:3, 3] - self.grip) > 8e-3:
            self._keep((np.linalg.norm(self.fat - self.fold, axis=1) > 13e-3) | self.firm)

    def _keep(self, kept):
        self.fat, self.glued, self.weak, self.firm = (
            one[kept] for one in (self.fat, self.glued, self.weak, self.firm)
        )
        self.lifted_from = self.lifted_from[kept]

    def _burn(self, power):
        super()._burn(power)
        self._strip()
        end = self.hands["PSM1"].bare_end
        near = np.linalg.norm(self.fat - end, axis=1) < 0.012
        self.lifted_from[near] = np.fmin(self.lifted_from, end[2])[near]
        lifted = near & self.weak & (end[2] - self.lifted_from > 0.003)
        burnt = np.zeros_like(lifted)
        if power and near.any():
            self.delivered += 0.5 * power * PERIOD * 1e-9
            self.burns.append(end.copy())
            burnt = near & (np.linalg.norm(self.fat - end, axis=1) < 0.010)
        self._keep(~((lifted | burnt) & ~self.glued))
