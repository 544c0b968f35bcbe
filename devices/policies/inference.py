"""Asking a policy: opens it, asks, and turns every failure into a fault with its reason."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic, monotonic_ns

import numpy as np

from devices.policies.policy import Observation, Policy
from schemas.errors import MessageError, MissingExtraError, ScenarioError, TrocarError
from schemas.trocar_msgs import ActionChunk, PolicyObservation
from schemas.vectors import Vector

__all__ = ["Inference"]

_RETRY_S = 1.0
"""Time between two attempts to reach a policy that is away."""


class Inference:
    """A policy that may come, go, and come again."""

    def __init__(self, connect: Callable[[], Policy], episode: int) -> None:
        """`connect` opens the policy; `episode` is sent with each reset."""
        self._connect, self._episode = connect, episode
        self._policy: Policy | None = None
        self._away, self._retry_s = "", 0.0
        self._ended = False

    def open(self) -> str:
        """Try to reach the policy; return why it is away, empty if it is there.

        Raises ScenarioError if policy and contract do not fit.
        """
        try:
            policy = self._connect()
        except ScenarioError:
            raise
        except TrocarError as error:
            self._away, self._retry_s = str(error), monotonic() + _RETRY_S
            return self._away
        self._policy = policy
        if self._ended:  # meanwhile, by another thread
            self._release()
            return self._away
        try:
            policy.reset(self._episode)
        except TrocarError as error:
            self._drop(str(error))
        return self._away

    def answer(self, asked: PolicyObservation, question: Observation | str) -> ActionChunk:
        """Return the policy's answer, or the fault; a text in place of the question is the fault."""
        start_ns, fault = monotonic_ns(), ""
        rows = np.zeros((0, 0))
        try:
            rows = self._ask(question)
        except MissingExtraError:
            raise
        except MessageError as error:
            fault = str(error)
        except TrocarError as error:
            fault = str(error)
            self._drop(fault)
        return ActionChunk(
            header=asked.header,
            number=asked.number,
            width=rows.shape[1],
            actions=rows.ravel(),
            tips=asked.tips,
            fault=fault,
            inference_ns=monotonic_ns() - start_ns,
        )

    def _ask(self, question: Observation | str) -> Vector:
        if isinstance(question, str):
            raise MessageError(question)
        if self._ended:
            raise MessageError("the policy is not asked any more")
        if self._policy is None and monotonic() >= self._retry_s:
            self._away = ""
            self.open()
        if (policy := self._policy) is None:
            raise MessageError(self._away)
        return policy.act(question)

    def _drop(self, reason: str) -> None:
        """Close a policy that has failed; it is opened again at a later question."""
        self._release()
        self._away, self._retry_s = reason, monotonic() + _RETRY_S

    def close(self) -> None:
        """Close the policy for good."""
        self._ended = True
        self._release()

    def _release(self) -> None:
        policy, self._policy = self._policy, None
        if policy is not None:
            policy.close()
