"""Pictures and soft surfaces of a session, as sections of a frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.participant import Params, signal_out
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.ros import CompressedImage
from schemas.scenario import Scenario
from schemas.trocar_msgs import SoftBodyState
from webconsole.frame import Section, SectionKind, node_content
from webconsole.source import Outlet, Value
from webconsole.stage import Stage

SCENARIO = {
    "name": "shown",
    "step": "1 ms",
    "duration": "1 s",
    "participants": {"tissue": {"kind": "toys:Busy"}, "camera": {"kind": "toys:Busy"}},
}
OUTLETS = (
    Outlet("tissue", signal_out("nodes", SoftBodyState)),
    Outlet("camera", signal_out("picture", CompressedImage)),
)


@pytest.fixture(scope="module")
def stage():
    return Stage(Scenario.model_validate(SCENARIO), OUTLETS, lambda _: Params())


@given(st.binary(max_size=60), st.text("abz", max_size=9), st.text("xy", max_size=5))
def test_pages_get_the_bytes_of_a_picture_and_the_nodes_of_a_surface(stage, data, frame_id, word):
    picture = CompressedImage(header={"frame_id": frame_id}, format=word, data=np.frombuffer(data, np.uint8))
    payload = encode(picture)
    assert stage.section("camera.picture", Value(0, payload)) == Section(SectionKind.PICTURE, 0, data)
    for size in range(len(payload)):
        with pytest.raises(MessageError):
            stage.section("camera.picture", Value(0, payload[:size]))
    nodes = np.arange(3.0 * len(data), dtype=np.float32)
    state = SoftBodyState(header={"frame_id": frame_id}, body=word, nodes_m=nodes)
    content = node_content(nodes) if data else b""
    assert stage.section("tissue.nodes", Value(0, encode(state))) == Section(SectionKind.NODES, 0, content)
