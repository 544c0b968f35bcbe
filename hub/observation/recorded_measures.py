"""The measures of a recorded session."""

from __future__ import annotations

import numpy as np

from hub.observation.measures import Measures
from hub.recording.recording import Recording
from schemas.errors import RecordingError
from schemas.ros import DiagnosticStatus
from schemas.trocar_msgs import ScoreCard

__all__ = ["recorded_measures"]


def recorded_measures(recording: Recording) -> Measures:
    """Return the measures and score cards at the end of a recording, as in the summary of the run.

    Raises RecordingError if the recording is not of a session, or if values cannot be read.
    """
    scenario, plan = recording.scenario(), recording.plan()
    if missing := {one.of.participant for one in scenario.measure.values()} - plan.participants.keys():
        raise RecordingError(f"'{recording.file}' measures '{min(missing)}', which its plan does not have")
    measures = Measures(scenario, plan)
    for participant, port in measures.ports:
        name = f"{participant}.{port}"
        if name not in recording:
            continue
        series = recording[name]
        if recording.ports[name] in (ScoreCard.ros_type, DiagnosticStatus.ros_type):
            for time_s, message in series.messages():
                measures.add(participant, port, message, round(time_s * 1e9))
        elif len(series.values):  # none of a type without a vector
            for time_s, value in zip(series.time.tolist(), series.values, strict=True):
                measures.add(participant, port, np.ascontiguousarray(value), round(time_s * 1e9))
    return measures
