"""The suture planner's topics as markers, stepped by hand."""

from pathlib import Path

from controllers import vrep_sutures
from controllers.vrep_sutures import VrepSutures, VrepSuturesParams
from devices.ros.params import GatewayParams
from devices.ros.topics.vrep_table import vrep_table
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from schemas.ros import BoolMessage, Point, Pose, Quaternion, StringMessage
from schemas.visualization import MarkerAction, MarkerType

H = 5_000_000


class Planner:
    """A controller that hears one message on each of some topics."""

    def __init__(self):
        self.sutures = VrepSutures("sutures", VrepSuturesParams())
        assert self.sutures.configure(Setup(H, Path())) == {"markers": ()}

    def say(self, **messages):
        events = {f"suture_planner/{topic}": (message,) for topic, message in messages.items()}
        sent = self.sutures.step(0, H, Inputs({}, events=events))["markers"]
        return [marker for array in sent for marker in array.markers]


def at(x):
    return Pose(position=Point(x=x))


def test_every_topic_of_the_planner_is_a_port_of_the_same_type():
    there = {port.name: port for port in VrepSutures("sutures", VrepSuturesParams()).ports}
    rows = [row for row in vrep_table(GatewayParams(profile="vrep")) if row.owner == "suture_planner"]
    assert len(rows) == 6
    for row in rows:
        assert (there[row.port.name].type, there[row.port.name].variability) == (row.type, "event")


def test_the_banner_is_there_from_the_start_and_then_has_the_last_word():
    planner = Planner()
    (banner,) = planner.say()
    assert (banner.text, banner.type, banner.scale.z) == ("Teleoperation", MarkerType.TEXT_VIEW_FACING, 6e-3)
    assert banner.header.frame_id == "endoscope_left_optical"
    assert planner.say() == []
    (banner,) = planner.say(state_current=StringMessage(data="Insert the needle"))
    assert (banner.text, banner.action) == ("Insert the needle", MarkerAction.ADD)
    (banner,) = planner.say(state_current=StringMessage(data=" "))
    assert banner.action == MarkerAction.DELETE


def test_insertions_are_blue_and_extractions_red_until_they_are_deleted():
    planner = Planner()
    planner.say()
    blue, red = planner.say(suture_position_sx=at(0.01), suture_position_dx=at(0.02))
    assert [(m.ns, m.id) for m in (blue, red)] == [("suture_planner/sx", 0), ("suture_planner/dx", 0)]
    assert (blue.color.r, blue.color.b, red.color.r, red.color.b) == (0.0, 1.0, 1.0, 0.0)
    assert {blue.header.frame_id, red.header.frame_id} == {"PSM1_base"}
    assert (blue.pose.position.x, blue.scale.x, blue.frame_locked) == (0.01, 1e-3, True)
    (second,) = planner.say(suture_position_sx=at(0.03))
    assert second.id == 1
    assert planner.say(delete_stitches=BoolMessage(data=False)) == []
    deleted = planner.say(delete_stitches=BoolMessage(data=True), suture_position_sx=at(0.04))
    assert [m.action for m in deleted] == [MarkerAction.DELETEALL, MarkerAction.DELETEALL, MarkerAction.ADD]
    assert {m.ns for m in deleted[:2]} == {"suture_planner/sx", "suture_planner/dx"}
    assert deleted[2].id == 0


def test_after_the_last_point_there_is_room_for_the_oldest_is_replaced(monkeypatch):
    monkeypatch.setattr(vrep_sutures, "_MOST_POINTS", 2)
    planner = Planner()
    planner.say()
    assert [planner.say(suture_position_dx=at(0.0))[0].id for _ in range(3)] == [0, 1, 0]


def test_the_disc_is_as_large_as_the_needle_and_the_second_user_position_does_nothing():
    planner = Planner()
    planner.say()
    turn = Quaternion(x=1.0, w=0.0)
    (disc,) = planner.say(user_position=Pose(orientation=turn), user_position_2=Pose())
    assert (disc.type, disc.scale.x, disc.pose.orientation) == (MarkerType.CYLINDER, 23e-3, turn)
    assert 0.0 < disc.color.a < 1.0


def test_the_number_of_points_is_saved():
    planner, other = Planner(), Planner()
    planner.say(suture_position_sx=at(0.0))
    before = planner.sutures.state_hash()
    other.sutures.restore(planner.sutures.save())
    assert other.sutures.state_hash() == before
    assert other.say(suture_position_sx=at(0.0))[0].id == 1


def test_it_conforms():
    check_engine(lambda: VrepSutures("sutures", VrepSuturesParams()), period_ns=H)
