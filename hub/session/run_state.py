"""Whether a session runs, is paused or shall end."""

from __future__ import annotations

import threading

__all__ = ["RunState"]


class RunState:
    """Whether the session runs, is paused or shall end; shared by the step loop and the control threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._budget: int | None = None
        self._ending = False

    def pause(self) -> None:
        """Take no further step."""
        self._set(0)

    def resume(self) -> None:
        """Continue without a limit."""
        self._set(None)

    def step(self, steps: int) -> None:
        """Take `steps` more steps, then pause."""
        with self._changed:
            self._budget = steps + (self._budget or 0)
            self._changed.notify_all()

    def shutdown(self) -> None:
        """End the session at the next communication point."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()

    def _set(self, budget: int | None) -> None:
        with self._changed:
            self._budget = budget
            self._changed.notify_all()

    @property
    def ending(self) -> bool:
        """Whether the session shall end."""
        return self._ending

    @property
    def budget(self) -> int | None:
        """Steps allowed before the next pause; None: no limit."""
        return self._budget

    def wait(self, timeout_s: float) -> bool:
        """Wait while paused, at most `timeout_s`; return whether the session may continue."""
        with self._changed:
            self._changed.wait_for(lambda: self._budget != 0 or self._ending, timeout_s)
            return self._budget != 0 or self._ending

    def spend(self, steps: int) -> None:
        """Subtract completed steps from the budget."""
        with self._changed:
            if self._budget is not None:
                self._budget = max(self._budget - steps, 0)
