"""Parameters of a bag played into a session."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from devices.ros.params import GatewayParams, TopicParams
from devices.ros.topics.dvrk_table import dvrk_table
from devices.ros.topics.row import Row
from devices.ros.topics.vrep_table import vrep_table
from hub.recording.ros_bag_reader import BagTopic, RosBag
from schemas.errors import RecordingError, did_you_mean
from schemas.files import find_file
from schemas.quantity import Duration

__all__ = ["BagParams", "listed_topics"]

_NAMED = 6
"""Most topics named in a message."""


class BagParams(TopicParams):
    """The bag to play, the manner of playing, and the topics."""

    bag: Path = Field(
        description="rosbag2 directory, .mcap, .db3, or .bag of ROS 1, relative to the scenario"
    )
    start: Duration = Field(default=0, ge=0, description="time of the bag at which playing begins")
    rate: float = Field(
        default=1.0,
        gt=0.0,
        allow_inf_nan=False,
        description="speed of playing; 2 is twice as fast as recorded",
    )
    rename: Mapping[str, str] = Field(
        default={},
        description=(
            "topics of the bag to topics of the dVRK: {/dvrk/PSM1/set_position_goal_joint: /PSM1/move_jp}"
        ),
    )

    @field_validator("bag")
    @classmethod
    def _find(cls, bag: Path, info: ValidationInfo) -> Path:
        return find_file(bag, info)

    @model_validator(mode="after")
    def _has_something_to_play(self) -> Self:
        try:
            with RosBag(self.bag) as bag:
                topics = bag.topics
        except RecordingError as error:
            raise ValueError(str(error)) from error
        unknown = next((topic for topic in self.rename if topic not in topics), None)
        if unknown is not None:
            raise ValueError(f"rename: '{self.bag}' has no topic '{unknown}'.{did_you_mean(unknown, topics)}")
        if not self.played(topics):
            subscribed = (
                ", ".join(row.topic for row in self.subscribed.values())
                or "none: `arms` and `listen` are empty"
            )
            raise ValueError(
                f"'{self.bag}' has nothing that could be played here. Its topics:"
                f" {listed_topics(topics) or 'none'}. Topics that are subscribed to: {subscribed}"
            )
        return self

    @property
    def subscribed(self) -> Mapping[str, Row]:
        """Rows subscribed to by a gateway, by topic."""
        shared = {name: getattr(self, name) for name in TopicParams.model_fields}
        params = GatewayParams(**shared)
        rows = dvrk_table(params) if self.profile == "dvrk" else vrep_table(params)
        return {row.topic: row for row in rows if row.way == "subscribe" and row.port is not None}

    def played(self, topics: Mapping[str, BagTopic]) -> Mapping[str, Row]:
        """Return the played topics of a bag, each with its row."""
        subscribed = self.subscribed
        rows = {
            topic: subscribed.get(self.rename.get(topic, topic))
            for topic, recorded in topics.items()
            if recorded.messages
        }
        return {
            topic: row for topic, row in rows.items() if row is not None and row.type == topics[topic].type
        }


def listed_topics(topics: Mapping[str, BagTopic]) -> str:
    """Return a list of topics with their types and numbers of messages, cut after the first six."""
    named = [f"{topic} ({its.type}, {its.messages})" for topic, its in sorted(topics.items())]
    return ", ".join(named[:_NAMED]) + (f" and {len(named) - _NAMED} more" if len(named) > _NAMED else "")
