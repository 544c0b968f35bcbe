"""The Gymnasium environment: a stepped session with a watching task and `actions` for the hands."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from copy import deepcopy
from importlib.resources import files
from math import pi
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

import trocar
from learning.environments.exercises import Exercise
from learning.environments.goals import Reward, event_bonus, reward
from learning.environments.view import EnvironmentView
from schemas.errors import MessageError, SessionError
from schemas.ros import Header, Image, Point, Pose, PoseStamped, Quaternion
from schemas.trocar_msgs import TaskEvent
from schemas.vectors import Vector
from tasks.task import Task

__all__ = ["ActionError", "Environment"]

Observation = dict[str, NDArray[Any]]

_FAR = 2.0
"""m; coordinates are clipped to this bound, for bounded spaces."""
_SETTLING_NS = 20_000_000
"""Time until the first action if objects are put: the period of the scenes' reports."""
_EYES = ("left", "right")
Control = Literal["displacement", "tip"]
_CONTROLS: dict[Control, str] = {
    "displacement": "x, y, z, turn and jaw, from -1 to 1,",
    "tip": "position, quaternion (x, y, z, w) and jaw opening",
}


class ActionError(MessageError, InvalidAction):
    """An action outside the action space."""


class Environment(gymnasium.Env[Observation, NDArray[np.float32]]):
    """An exercise as a goal environment.

    Args:
        exercise: Its class.
        reward: `sparse`, 0 once the goal is reached and else -1; `shaped`, by distance and the task's events.
        images: Observe the camera's stereo pictures too, `left` and `right`.
        looks: Of pictures: `plain`, or `endoscope` where Filament runs.
        randomise: Draw each episode's textures, colours, light, view, smoke and surroundings anew, from the
            episode's seed: True, or limits as in `randomise` of a camera. With `looks="endoscope"`.
        width: Of pictures, in pixels.
        height: Of pictures, in pixels.
        render_mode: `rgb_array` or None.
        record: A directory in which each episode is recorded, `episode-00000` and so on.
        terminate_on_success: End an episode when its goal is reached, instead of going on to hold it.
        control: `displacement`: actions of -1 to 1; `tip`: goals of the tips, as poses in the world.
        step: Simulated time of a step, s.
        delay: Age of observations, s, as of a slow camera or link; reward and success are of now.
        hashed: Keep `state_hash`. Without it, and without a recording, a step costs less, with the same bits.
        settings: Values of the scenario, as `trocar.load_scenario` takes them.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 5}  # pyright: ignore[reportIncompatibleVariableOverride]

    def __init__(
        self,
        exercise: type[Exercise],
        *,
        reward: Reward = "sparse",
        images: bool = False,
        looks: Literal["plain", "endoscope"] = "plain",
        randomise: bool | Mapping[str, Any] = False,
        width: int = 160,
        height: int = 120,
        render_mode: Literal["rgb_array"] | None = None,
        record: str | Path | None = None,
        terminate_on_success: bool = False,
        control: Control = "displacement",
        step: float = 0.2,
        delay: float = 0.0,
        hashed: bool = True,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        if reward not in ("sparse", "shaped"):
            raise ValueError(f"reward '{reward}' is neither 'sparse' nor 'shaped'")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode '{render_mode}' is neither None nor 'rgb_array'")
        self.reward: Reward = reward
        if looks not in ("plain", "endoscope"):
            raise ValueError(f"looks '{looks}' is neither 'plain' nor 'endoscope'")
        self.images, self.render_mode = images, render_mode
        self._randomise = None if randomise is False else {} if randomise is True else dict(randomise)
        self._record = None if record is None else Path(record)
        self._terminates = terminate_on_success
        self._control: Control = control
        scene = files("learning.environments") / "scenes" / f"{exercise.scene}.yaml"
        duration = f"{step:g} s"
        settling_ns = _SETTLING_NS if exercise.puts else 0
        own = {
            "participants.actions.control": control,
            "participants.actions.action_step": duration,
            "participants.actions.first_action": f"{settling_ns / 1e6:g} ms",
            "participants.task.period": duration,
            "participants.camera.width": width,
            "participants.camera.height": height,
            "participants.camera.looks": looks,
        }
        self._session = trocar.SteppedSession(
            trocar.load_scenario(str(scene), set={**own, **(settings or {})})
        )
        self._count = self._count_steps("step", step)
        if not self._count:
            self._session.close()
            raise ValueError(f"step {step:g} s: an environment's step takes time")
        late, self._lag = divmod(self._count_steps("delay", delay), self._count)
        self._past: deque[Observation] = deque(maxlen=late + 1)
        """Observations on their way, the oldest first."""
        self._advance = self._session.advance if hashed else self._session.leap
        self._settling = -(-settling_ns // self._session.plan.step_ns)
        self.exercise = exercise(cast("Task", self._session.participant("task")))
        self._view = self._new_view()
        self._describe_spaces(len(self._view.vector()), (height, width, 3))
        self._closed = False
        self._episode, self._seen, self._harm = 0, set[str](), 0.0
        self._goal = np.zeros(exercise.goal_size)
        self.events: tuple[TaskEvent, ...] = ()
        """Events of the task in the last step."""

    def _count_steps(self, name: str, duration: float) -> int:
        """Return the scenario's steps in a duration, s. Raises ValueError for another than a multiple."""
        count, rest = divmod(round(duration * 1e9), self._session.plan.step_ns)
        if rest or count < 0:
            self._session.close()
            raise ValueError(
                f"{name} {duration:g} s is no multiple of the scenario's"
                f" {self._session.plan.step_ns / 1e9:g} s"
            )
        return count

    def _new_view(self) -> EnvironmentView:
        return EnvironmentView(self._session, self.exercise.task, self.exercise.hands)

    def _describe_spaces(self, size: int, picture: tuple[int, int, int]) -> None:
        """Set the spaces."""
        goal = spaces.Box(-_FAR, _FAR, (self.exercise.goal_size,), np.float32)
        parts: dict[str, spaces.Space[Any]] = {
            "observation": spaces.Box(-_FAR, _FAR, (size,), np.float32),
            "achieved_goal": goal,
            "desired_goal": goal,
        }
        if self.images:
            parts |= {eye: spaces.Box(0, 255, picture, np.uint8) for eye in _EYES}
        self.observation_space = spaces.Dict(parts)  # pyright: ignore[reportAttributeAccessIssue, reportIncompatibleVariableOverride]
        self._limit, numbers = (1.0, 5) if self._control == "displacement" else (_FAR * pi, 8)
        self.action_space = spaces.Box(
            -self._limit, self._limit, (numbers * len(self.exercise.hands),), np.float32
        )

    @property
    def layout(self) -> dict[str, slice]:
        """Slice of each part of `observation`, by name."""
        layout: dict[str, slice] = {}
        at = 0
        for name, size in self._view.names().items():
            layout[name] = slice(at, at + size)
            at += size
        return layout

    @property
    def step_s(self) -> float:
        """Simulated time of a step, s."""
        return self._count * self._session.plan.step_ns / 1e9

    @property
    def time_s(self) -> float:
        """Simulated time since reset, s."""
        return self._session.time_ns / 1e9

    @property
    def goals(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The achieved and the desired goal now, however old the observations are."""
        return self._achieved(), self._clip(self._goal)

    @property
    def has_lost_object(self) -> bool:
        """Whether an object has fallen out of the scene."""
        return self.exercise.has_lost_object(self._view)

    @property
    def state_hash(self) -> str:
        """Hash of all states of the episode so far: equal for equal seeds and actions."""
        return self._session.state_hash

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; the `seed` decides the starting places and the goal.

        Objects are put and seen before the first action is due, after 20 ms; without any, the first action is
        due at once. The option `record` names a new directory for the recording of this episode.
        """
        self._require_open()
        super().reset(seed=seed)
        if unknown := sorted(set(options or {}) - {"record"}):
            raise ValueError(f"options {unknown}: there is only 'record'")
        starts, self._goal = self.exercise.draw(self.np_random)
        if self._randomise is not None:
            appearance = self._randomise | {"seed": int(self.np_random.integers(1 << 31))}
            self._session.change_observer("camera", {"randomise": appearance})
        named = (options or {}).get("record")
        self._session.restart(Path(named) if named else self._next_recording())
        self._view = self._new_view() if not self._session.restores else self._view
        self._seen.clear()
        self._harm = 0.0
        inputs = {f"robot.{thing}/place": (_stamp_pose(pose),) for thing, pose in starts.items()}
        self._session.advance(self._settling, inputs)
        self._past.clear()
        first = self._observe()
        self._past.extend(deepcopy(first) for _ in range(self._past.maxlen or 1))  # each is given away once
        return self._past[0], self._info(self._achieved(), 0.0)

    def _next_recording(self) -> Path | None:
        if self._record is None:
            return None
        while (place := self._record / f"episode-{self._episode:05d}").exists():
            self._episode += 1
        return place

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for a step. Values out of range are clipped.

        Raises ActionError for anything but finite numbers of the right shape, SessionError after `close`.
        """
        self._require_open()
        given = self._numbers(action)
        self._advance(self._count - self._lag, {"actions.action": given})
        self._past.append(self._observe())
        if self._lag:
            self._advance(self._lag)
            self._view.read()
        self.events = cast("tuple[TaskEvent, ...]", self._session["task.events"])
        harm, before = self.exercise.harm(self._view), self._harm
        self._harm = harm
        extra = event_bonus([event.event for event in self.events], self._seen) + before - harm
        achieved = self._achieved()
        info = self._info(achieved, extra)
        worth = float(self.compute_reward(achieved, self._clip(self._goal), info))
        terminated = self.has_lost_object or (self._terminates and info["is_success"])
        return self._past[0], worth, terminated, False, info

    def _numbers(self, action: Any) -> Vector:
        """Return an action as numbers, shape of the action space. Raises ActionError."""
        try:
            given = np.asarray(action)
            if given.dtype.kind in "biuf" and given.shape == self.action_space.shape:
                numbers = given.astype(np.float64)
                if np.isfinite(numbers).all():
                    return np.clip(numbers, -self._limit, self._limit)
        except (ValueError, TypeError):  # lists of several lengths, objects of other libraries
            pass
        raise ActionError(
            f"action {action!r:.200}: expected {self.action_space.shape} finite numbers,"
            f" {_CONTROLS[self._control]} of {' and '.join(self.exercise.hands)}"
        )

    def _require_open(self) -> None:
        if self._closed:
            raise SessionError("the environment is closed: make a new one with gymnasium.make")

    def compute_reward(
        self,
        achieved_goal: NDArray[Any],
        desired_goal: NDArray[Any],
        info: Mapping[str, Any] | Sequence[Mapping[str, Any]] | NDArray[Any],
    ) -> NDArray[np.float64]:
        """Return the reward of goals, shape (..., size): a single goal, or many as for hindsight replay."""
        return reward(self.reward, self.exercise.tolerance, achieved_goal, desired_goal, info)

    def _observe(self) -> Observation:
        self._view.read()
        found: Observation = {
            "observation": self._clip(self._view.vector()),
            "achieved_goal": self._achieved(),
            "desired_goal": self._clip(self._goal),
        }
        if self.images:
            found |= self._pictures()
        return found

    def _achieved(self) -> NDArray[np.float32]:
        return self._clip(self.exercise.achieved_goal(self._view))

    @staticmethod
    def _clip(values: Vector) -> NDArray[np.float32]:
        return np.clip(values, -_FAR, _FAR).astype(np.float32)

    def _info(self, achieved: NDArray[np.float32], extra: float) -> dict[str, Any]:
        reached = self.exercise.tolerance.is_reached(achieved, self._clip(self._goal))
        return {"is_success": bool(reached), "bonus": extra}

    def _pictures(self) -> dict[str, NDArray[np.uint8]]:
        outputs = self._session.look("camera")
        pictures: dict[str, NDArray[np.uint8]] = {}
        for eye in _EYES:
            messages = cast("tuple[Image, ...]", outputs[f"{eye}/image_raw"])
            if not messages:
                raise gymnasium.error.DependencyNotInstalled(
                    "no OpenGL works here, so there are no pictures: `trocar doctor` says what mends it"
                )
            image = messages[0]
            pictures[eye] = np.asarray(image.data).reshape(image.height, image.width, 3).copy()
        return pictures

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return the camera's left picture, shape (height, width, 3)."""
        self._require_open()
        return self._pictures()["left"] if self.render_mode else None

    def close(self) -> None:
        """End the recording and release the engines."""
        self._closed = True
        self._session.close()


def _stamp_pose(pose: Vector) -> PoseStamped:
    x, y, z, i, j, k, w = pose.tolist()
    where = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
    return PoseStamped(header=Header(frame_id="world"), pose=where)
