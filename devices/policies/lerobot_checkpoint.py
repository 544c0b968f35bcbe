"""A checkpoint of LeRobot as a policy, in the process of `worker.py` and its interpreter.

Pictures go in under the checkpoint's own names `observation.images.<name>`: by the camera's name, `/` as `_`
or `.`, else in the contract's order. The answer is the chunk of `predict_action_chunk` after the checkpoint's
own processors. LeRobot 0.4 to 0.6 (huggingface/lerobot, src/lerobot/policies/factory.py).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LeRobotCheckpoint"]

_STATE, _PICTURES = "observation.state", "observation.images."


class LeRobotCheckpoint:
    """A policy of a directory, or of a name on the Hub that is in the cache of this machine."""

    def __init__(self, place: str, contract: dict[str, Any]) -> None:
        """Load the policy and its processors. Raises ValueError for features that a session does not have."""
        # by name: a checker of types need not have them
        self._torch: Any = import_module("torch")
        configs: Any = import_module("lerobot.configs.policies")
        factory: Any = import_module("lerobot.policies.factory")
        config: Any = configs.PreTrainedConfig.from_pretrained(place)
        self._policy: Any = factory.get_policy_class(config.type).from_pretrained(place, config=config)
        self._policy.eval()
        processors: tuple[Any, Any] = factory.make_pre_post_processors(
            self._policy.config, pretrained_path=place
        )
        self._before, self._after = processors
        features: dict[str, Any] = dict(config.input_features)
        self._cameras = _match_cameras([key for key in features if key.startswith(_PICTURES)], contract)
        self._has_state = _STATE in features
        stated = {"action": int(config.output_features["action"].shape[0])}
        if self._has_state:
            stated["state"] = int(features[_STATE].shape[0])
        self.metadata: dict[str, Any] = {"contract": stated, "type": config.type}

    def reset(self, episode: int) -> None:  # noqa: ARG002
        """Forget the actions of the episode before."""
        self._policy.reset()

    def act(self, observation: dict[str, Any]) -> NDArray[Any]:
        """Return the rows."""
        torch = self._torch
        batch: dict[str, Any] = {"task": [observation["prompt"]]}
        if self._has_state:
            batch[_STATE] = torch.from_numpy(observation["state"].astype(np.float32)[None])
        for key, camera in self._cameras.items():
            pixels = np.ascontiguousarray(observation["images"][camera].transpose(2, 0, 1)[None])
            batch[key] = torch.from_numpy(pixels.astype(np.float32) / 255.0)
        with torch.inference_mode():
            chunk: Any = self._policy.predict_action_chunk(self._before(batch))
            rows: list[Any] = [self._after(chunk[:, row]) for row in range(chunk.shape[1])]
        return np.concatenate([np.asarray(row.cpu().numpy(), np.float32) for row in rows])


def _match_cameras(keys: list[str], contract: dict[str, Any]) -> dict[str, str]:
    """Return the camera of each picture of the policy."""
    cameras = list(contract["cameras"])
    named = {name.replace("/", sign): name for name in cameras for sign in ("/", "_", ".")}
    found = {key: named[key[len(_PICTURES) :]] for key in keys if key[len(_PICTURES) :] in named}
    left = [camera for camera in cameras if camera not in found.values()]
    for key in keys:
        if key not in found:
            if not left:
                raise ValueError(
                    f"the policy needs '{key}'; the contract has {', '.join(cameras) or 'no camera'}"
                )
            found[key] = left.pop(0)
    return found
