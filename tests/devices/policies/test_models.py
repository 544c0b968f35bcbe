"""Models in files as policies: ONNX, and a checkpoint of LeRobot with a stand-in of its library."""

import numpy as np
import pytest

from devices.policies.policy import Observation, open_policy
from schemas.errors import DeviceError, ScenarioError
from tests.devices.policies.test_child import STATE, terms

PICTURE = np.full((16, 32, 3), 51, np.uint8)
CAMERAS = {"endoscope/left": {"width": 32, "height": 16}}


def write_model(path, *, picture="endoscope_left", width=8):
    """Rows of the state, the first number plus the mean of the picture."""
    onnx = pytest.importorskip("onnx")
    from onnx import TensorProto, helper

    nodes = [
        helper.make_node("ReduceMean", [f"observation.images.{picture}", "axes"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "first"], ["shift"]),
        helper.make_node("Add", ["observation.state", "shift"], ["row"]),
        helper.make_node("Concat", ["row", "row"], ["rows"], axis=0),
        helper.make_node("Unsqueeze", ["rows", "batch"], ["action"]),
    ]
    constants = [
        helper.make_tensor("axes", TensorProto.INT64, [3], [1, 2, 3]),
        helper.make_tensor("first", TensorProto.FLOAT, [width], [1.0] + [0.0] * (width - 1)),
        helper.make_tensor("batch", TensorProto.INT64, [1], [0]),
    ]
    inputs = [
        helper.make_tensor_value_info("observation.state", TensorProto.FLOAT, [1, width]),
        helper.make_tensor_value_info(f"observation.images.{picture}", TensorProto.FLOAT, [1, 3, 16, 32]),
    ]
    outputs = [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, 2, width])]
    graph = helper.make_graph(nodes, "policy", inputs, outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, path)


def test_an_onnx_model_gets_state_and_pictures_by_name(tmp_path):
    pytest.importorskip("onnxruntime")
    write_model(tmp_path / "model.onnx")
    policy = open_policy("onnx:model.onnx", terms(cameras=CAMERAS), timeout_s=60.0, directory=tmp_path)
    answer = policy.act(Observation(1, {"endoscope/left": PICTURE}, STATE))
    policy.close()
    assert answer == pytest.approx(np.tile(STATE + np.array([0.2, *np.zeros(7)]), (2, 1)), abs=1e-6)


@pytest.mark.parametrize(
    ("model", "error", "said"),
    [
        (
            {"picture": "wrist"},
            DeviceError,
            "has an input 'observation.images.wrist'; the contract has state",
        ),
        ({"width": 7}, ScenarioError, "action: the policy has 7 numbers, the contract 8"),
    ],
)
def test_an_onnx_model_that_does_not_fit_is_named(tmp_path, model, error, said):
    pytest.importorskip("onnxruntime")
    write_model(tmp_path / "model.onnx", **model)
    with pytest.raises(error, match=said):
        open_policy("onnx:model.onnx", terms(cameras=CAMERAS), timeout_s=60.0, directory=tmp_path)


LIBRARY = {
    "torch.py": """
import contextlib
import numpy as np
class Tensor(np.ndarray):
    def cpu(self): return self
    def numpy(self): return np.asarray(self)
def from_numpy(array): return array.view(Tensor)
inference_mode = contextlib.nullcontext
""",
    "lerobot/configs/policies.py": """
class Feature:
    def __init__(self, *shape): self.shape = shape
class PreTrainedConfig:
    type = "act"
    input_features = {"observation.state": Feature(8), "observation.images.top": Feature(3, 16, 32)}
    output_features = {"action": Feature(8)}
    @classmethod
    def from_pretrained(cls, place):
        assert place == "checkpoint", place
        return cls()
""",
    "lerobot/policies/factory.py": """
import numpy as np
class Policy:
    @classmethod
    def from_pretrained(cls, place, config):
        made = cls()
        made.config = config
        return made
    def eval(self): pass
    def reset(self): self.was_reset = True
    def predict_action_chunk(self, batch):
        assert self.was_reset and batch["task"] == ["stay"], batch["task"]
        picture = batch["observation.images.top"]
        assert picture.shape == (1, 3, 16, 32), picture.shape
        row = batch["observation.state"] + float(picture.mean())
        return np.stack([row, row], axis=1).view(type(row))
def get_policy_class(name):
    assert name == "act"
    return Policy
def make_pre_post_processors(config, pretrained_path):
    return (lambda batch: batch), (lambda row: 2.0 * row)
""",
}


def test_a_checkpoint_of_lerobot_gets_its_features_and_its_chunk_comes_back(tmp_path):
    for name, text in LIBRARY.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    made = terms(cameras=CAMERAS)
    policy = open_policy("lerobot:checkpoint", made, timeout_s=60.0, directory=tmp_path)
    policy.reset(0)
    answer = policy.act(Observation(1, {"endoscope/left": PICTURE}, STATE, "stay"))
    policy.close()
    assert answer == pytest.approx(np.tile(2.0 * (STATE + 0.2), (2, 1)), abs=1e-5)
    with pytest.raises(DeviceError, match=r"needs 'observation\.images\.top'; the contract has no camera"):
        open_policy("lerobot:checkpoint", terms(), timeout_s=60.0, directory=tmp_path)
