"""The clip-and-cut routine without physics: tips go where they are sent, tubes follow the gallbladder."""

from pathlib import Path

import numpy as np

from controllers.cholecystectomy.controller import ClipAndCut
from controllers.cholecystectomy.sub_task import SubTask
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots.dvrk.inverse import inverse
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.ros import Header, Point, StringMessage
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TubeLine

__all__ = ["SCENE", "World"]

SCENE = Path(__file__).with_name("two-tubes.yaml")
PERIOD = 40_000_000
"""Four periods of the scenario, ns: the routine does the same in a quarter of the steps."""
HEADER = Header(frame_id="world")
STIFFNESS = 60.0
"""Pull of the gallbladder over its way, N/m."""
MIDDLE = 9e-3
"""Distance of the middle of the jaws from the hinge, m."""
NECK = np.array([[0.0, -1.0, 0.0], [0.0, 5.0, 0.0]]) * 1e-3
FAR = np.array([[20.5, -15.4, 0.0], [24.6, 9.3, 0.0]]) * 1e-3


class World:
    """Two tubes between a gallbladder and two fixed places."""

    def __init__(self, *settings, far=FAR):
        given = load(SCENE, [f"participants.routine.{setting}" for setting in settings]).params["routine"]
        self.routine = ClipAndCut("routine", given)
        self.routine.configure(Setup(PERIOD, "."))
        self.hands = {hand.arm: hand for hand in self.routine._hands}
        self.joints = {arm: np.array(given.arms.present_arms[arm].start) for arm in self.hands}
        self.jaws = dict.fromkeys(self.hands, 0.0)
        self.nodes = np.stack(np.meshgrid(*[np.linspace(*ends, 9) for ends in ((-16, 0), (-4, 8), (-5, 5))]))
        self.nodes = 1e-3 * self.nodes.reshape(3, -1).T
        self.far, self.shift, self.grip = np.array(far), np.zeros(3), None
        self.sway = np.zeros(3)
        """Way of both tubes beside their gallbladder, m."""
        self.clips, self.cuts = [[], []], [None, None]
        self.misses = self.slips = self.blunt = 0
        """How often the next grasps, clips and cuts fail."""
        self.events, self.refused, self.t = ([], []), [], 0
        self.astray = np.zeros((2, 3))
        """Distance of each clip from where it was meant to close, on each tube, m."""
        self.leaks = [None, None]
        """Distance from the cut at which each tube leaks until it is clipped beyond, m."""
        self.spared = np.full((1, 3), 0.2)
        """Nodes of an organ `wall` to be spared, m."""
        self.tasks, self.said, self.instructions, self.held = [], [], [], False

    @property
    def state(self):
        """State of the routine."""
        return self.routine._surgeon.state

    def tip(self, arm):
        """Pose of a tip in the world, shape (4, 4)."""
        hand = self.hands[arm]
        return hand.base @ hand.chain.forward(self.joints[arm])

    def line(self, tube):
        """Present line of a tube."""
        rest = NECK[tube], self.far[tube]
        ends = NECK[tube] + self.shift + self.sway, self.far[tube] + self.sway
        length = float(np.linalg.norm(rest[1] - rest[0]))
        share = np.linspace(0.0, 1.0, 26)
        points = ends[0] + share[:, None] * (ends[1] - ends[0])
        parted = np.zeros(26, np.uint8)
        if self.cuts[tube] is not None:
            parted[int(self.cuts[tube] / length * 25)] = 1
        return TubeLine(
            header=HEADER,
            body="",
            points_m=points.ravel(),
            along_m=share * length,
            areas_m2=np.full(26, 3e-6),
            diameters_m=np.full(26, 4e-3),
            shut=np.zeros(26, np.uint8),
            parted=parted,
        )

    def step(self):
        """Advance by a period."""
        values = {
            "PSM2/held": np.array([float(self.held)]),
            "PSM2/pull": -STIFFNESS * self.shift if self.held else np.zeros(3),
            "gallbladder/nodes": SoftBodyState(
                header=HEADER, body="", nodes_m=(self.nodes + self.shift).astype(np.float32).ravel()
            ),
        }
        values["wall/nodes"] = SoftBodyState(header=HEADER, body="", nodes_m=np.float32(self.spared).ravel())
        for tube, name in enumerate(self.routine.params.tubes):
            values[f"{name}/line"] = self.line(tube)
        for arm, hand in self.hands.items():
            local = hand.chain.forward(self.joints[arm])
            values[f"{arm}/local/measured_cp"] = matrix_to_pose(local)
            values[f"{arm}/jaw/measured_js"] = np.array([self.jaws[arm], 0.0, 0.0])
            values[f"{arm}/measured_js"] = np.concatenate([self.joints[arm], np.zeros(12)])
        events = {f"{name}/events": tuple(self.events[i]) for i, name in enumerate(self.routine.params.tubes)}
        events |= {f"{arm}/error": (StringMessage(data=text),) for arm, text in self.refused}
        self.events, self.refused = ([], []), []
        out = self.routine.step(self.t, PERIOD, Inputs(values, events={k: v for k, v in events.items() if v}))
        self.t += PERIOD
        self.said += [message.data for message in out["status"]]
        self.instructions += [message.data for message in out["instruction"]]
        if not self.tasks or self.tasks[-1] is not self.state.sub_task:
            self.tasks.append(self.state.sub_task)
        for arm in self.hands:
            self._follow(arm, out)
        if out["PSM1/clip"]:
            self._clip()
        return out

    def _follow(self, arm, out):
        hand = self.hands[arm]
        for message in out[f"{arm}/servo_cp"]:
            pose, turn = message.pose.position, message.pose.orientation
            goal = pose_to_matrix(np.array([pose.x, pose.y, pose.z, turn.x, turn.y, turn.z, turn.w]))
            try:
                self.joints[arm] = inverse(hand.chain, goal, self.joints[arm])
            except MotionError as error:
                self.refused.append((arm, str(error)))
        if self.grip is not None and arm == "PSM2":
            self.shift = self.tip(arm)[:3, 3] - self.grip
        for message in out[f"{arm}/jaw/move_jp"]:
            closes = float(message.position[0]) < self.jaws[arm]
            self.jaws[arm] = float(message.position[0])
            if arm == "PSM2":
                self._grasp(closes)
            elif arm == "PSM3" and closes:
                self._cut()

    def _grasp(self, closes):
        if not closes:
            self.held, self.grip = False, None
            return
        tip = self.tip("PSM2")
        ends = tip[:3, 3] + 0.012 * tip[:3, 2]
        near = np.linalg.norm(self.nodes + self.shift - ends, axis=1).min() < 4e-3
        if near and not self.misses:
            self.held, self.grip = True, tip[:3, 3] - self.shift
        self.misses = max(0, self.misses - 1)

    def lose_grasp(self):
        """Let the gallbladder slip out of the jaw, and back."""
        self.held, self.grip, self.shift = False, None, np.zeros(3)

    def _between(self, arm):
        """Return the tube between the jaws of an arm, and the place; None: none is."""
        tip = self.tip(arm)
        middle = tip[:3, 3] + MIDDLE * tip[:3, 2]
        for tube in range(2):
            line = self.line(tube)
            points = line.points_m.reshape(-1, 3)
            along = points[-1] - points[0]
            length = float(np.linalg.norm(along))
            along /= length
            place = float((middle - points[0]) @ along)
            off = np.linalg.norm(middle - points[0] - place * along)
            if off < 4e-3 and 0.0 < place < length:
                assert abs(tip[:3, 2] @ along) < 0.15  # across the tube
                assert abs(tip[:3, 0] @ along) > 0.98  # which the blades do not slant against
                return tube, place * float(line.along_m[-1]) / length, middle
        return None

    def _say(self, tube, kind, arm, middle, size=1.2e-3):
        x, y, z = middle.tolist()
        event = TissueEvent(
            header=HEADER, kind=kind, instrument=arm, position=Point(x=x, y=y, z=z), size=size
        )
        self.events[tube].append(event)

    def _clip(self):
        found = self._between("PSM1")
        if found is None or self.slips:
            self.slips = max(0, self.slips - 1)
            self._say(0, "clip slipped", "PSM1", self.tip("PSM1")[:3, 3])
            return
        tube, place, middle = found
        number = len(self.clips[tube])
        if number < 3 and (off := self.astray[tube, number]):
            place, line = place + off, self.line(tube)
            points = line.points_m.reshape(-1, 3)
            middle = np.array([np.interp(place, line.along_m, points[:, axis]) for axis in range(3)])
        if self.leaks[tube] is not None and self.cuts[tube] is not None and place > self.cuts[tube]:
            self.leaks[tube] = None
            self._say(tube, "bleeding stopped", "", middle)
        self.clips[tube].append(place)
        self._say(tube, "clipped", "PSM1", middle)

    def pull_off(self, tube, number):
        """Take a clip off."""
        place = self.clips[tube].pop(number)
        line = self.line(tube)
        at = np.array([np.interp(place, line.along_m, line.points_m.reshape(-1, 3)[:, i]) for i in range(3)])
        self._say(tube, "clip pulled off", "", at, 4.5)

    def _cut(self):
        found = self._between("PSM3")
        if found is not None and not self.blunt:
            self.cuts[found[0]] = found[1]
            if (leak := self.leaks[found[0]]) is not None:
                self._say(found[0], "bleeding", "", found[2] + leak * (self.far - NECK)[found[0]] / 0.025)
        self.blunt = max(0, self.blunt - 1)

    def run(self, until=None, seconds=200.0):
        """Go on until the routine is done, has failed, or `until` is true; return the last sub-task."""
        while self.t < seconds * 1e9:
            self.step()
            if self.state.done or self.state.failed or (until is not None and until(self)):
                return self.state.sub_task
        raise AssertionError(f"not done in {seconds} s: {self.said}")

    def is_at(self, task: SubTask):
        """Whether a sub-task is under way."""
        return self.state.sub_task is task
