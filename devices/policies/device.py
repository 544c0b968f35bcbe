"""Kind `policy`: asks a policy for actions, and enters its answers into the session as samples.

The governor (kind `governor`) publishes observations; each goes to the policy with the newest picture of
every camera. The answer enters with the observation's instant and number. In simulated time the session waits
for the answer; in wall time a thread asks, and answers enter when they arrive.
"""

from __future__ import annotations

import threading
from collections import deque
from functools import partial
from pathlib import Path
from typing import ClassVar, cast

from devices.diagnosis import Diagnosis, Level
from devices.policies.inference import Inference
from devices.policies.params import PolicyParams
from devices.policies.policy import open_policy
from devices.policies.questions import Questions, picture_port
from devices.samples import clock_of
from hub.participant import Device, Params, Sample, Value, event_in, event_out
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import Image
from schemas.trocar_msgs import ActionChunk, PolicyObservation

__all__ = ["PolicyDevice"]


class PolicyDevice(Device):
    """A policy, behind one of the protocols of `devices.policies.policy`."""

    params_model: ClassVar[type[Params]] = PolicyParams
    params: PolicyParams

    def __init__(self, name: str, params: PolicyParams) -> None:
        super().__init__(name, params)
        self._simulated = params.time == "simulated"
        self._terms = params.terms
        self._diagnosis = Diagnosis(name, simulated_time=self._simulated)
        self._questions = Questions(self._terms)
        self._inference: Inference | None = None
        self._answers: deque[ActionChunk] = deque()
        self._problems: deque[str] = deque()
        self._asked, self._answered = threading.Event(), threading.Event()
        self._asking = threading.Lock()
        self._thread: threading.Thread | None = None
        self._ending = False

    @property
    def ports(self) -> tuple[Port, ...]:
        """Observations and pictures in; answers and diagnoses out."""
        clock = clock_of(simulated_time=self._simulated)
        return (
            event_in("observation", PolicyObservation, "readings at which the policy is asked"),
            *(
                event_in(picture_port(camera), Image, f"pictures of {size.width} x {size.height}, rgb8")
                for camera, size in self._terms.cameras.items()
            ),
            event_out("actions", ActionChunk, "answers of the policy, and its faults", clock=clock),
            self._diagnosis.port,
        )

    def open(self, directory: Path) -> None:
        """Reach the policy; a policy that is away is tried again with the observations.

        Raises ScenarioError if policy and contract do not fit.
        """
        self.close()
        self._ending = False
        params = self.params
        connect = partial(
            open_policy,
            params.backend,
            self._terms,
            timeout_s=params.timeout * 1e-9,
            directory=directory,
            python=params.python,
        )
        self._questions = Questions(self._terms)
        self._inference = Inference(connect, params.episode)
        if away := self._inference.open():
            self._problems.append(away)
        if not self._simulated:
            self._thread = threading.Thread(target=self._run, name=f"policy {self.name}", daemon=True)
            self._thread.start()

    def write(self, port: str, value: Value) -> None:
        """Keep an observation or a picture. Raises MessageError for another message."""
        messages = value if isinstance(value, tuple) else (cast("Message", value),)
        with self._asking:
            for message in messages:
                self._questions.accept(port, message)
        self._asked.set()

    def read(self, t: int) -> list[Sample]:  # noqa: ARG002
        """Return the answers since the last call; in simulated time, ask and wait for the answer."""
        if self._simulated:
            self._answer_newest()
        self._answered.clear()
        samples: list[Sample] = []
        while self._answers:
            answer = self._answers.popleft()
            samples.append(Sample("actions", answer))
            samples += self._diagnosis.report(
                Level.ERROR if answer.fault else Level.OK, answer.fault or "the policy answers"
            )
        while self._problems:
            samples += self._diagnosis.report(Level.ERROR, self._problems.popleft())
        return samples

    def wait(self, seconds: float) -> bool:
        """Wait for an answer."""
        return self._answered.wait(seconds)

    def _run(self) -> None:
        while not self._ending:
            if self._asked.wait(0.1):
                self._asked.clear()
                self._answer_newest()

    def _answer_newest(self) -> None:
        with self._asking:
            taken = self._questions.take()
        if taken is not None and self._inference is not None:
            self._answers.append(self._inference.answer(*taken))
            self._answered.set()

    def close(self) -> None:
        """Release the policy."""
        self._ending = True
        self._asked.set()
        if self._inference is not None:
            self._inference.close()  # ends a question on its way
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._inference is not None:
            self._inference.close()  # a policy that was reached meanwhile
            self._inference = None
