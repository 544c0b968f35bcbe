"""The devices led from pages: each hosted by the pages' server, in a thread joined to the session."""

from __future__ import annotations

import logging
import os
import threading
from functools import partial

from devices.browser import PageInput, hand_of
from devices.browser.pair import BrowserPair
from devices.keyboard.virtual_stylus import Wish
from devices.vendor_axes import Quaternion, Vector3, quaternion, vector
from hub.planning.plan import Plan
from hub.remote.device_host import DeviceHost
from hub.remote.hub_connection import reach
from hub.transport.control_messages import JoinRequest
from schemas.errors import MessageError, TrocarError
from schemas.keys import Keys
from webconsole.commands import Hand
from webconsole.pilot import Offer, Pilots

__all__ = ["HostedDevices"]

log = logging.getLogger(__name__)

_KIND, _PAIR = "browser", "browser-pair"
_PATIENCE_S = 2.0


class _StopError(Exception):
    """Ends a device's thread."""


class HostedDevices:
    """Hosts the devices of kinds `browser` and `browser-pair` of each session shown, and their hands."""

    def __init__(self, pilots: Pilots) -> None:
        self._pilots = pilots
        self._endpoints: dict[str, str] = {}
        """Endpoint of the hub of a device's newest session, by device."""
        self._threads: dict[str, threading.Thread] = {}
        self._ending = threading.Event()

    def join(self, endpoint: str, plan: Plan) -> None:
        """Host the devices for pages to lead in a session; devices hosted by another process are left alone.

        Each device is offered once the device takes part: a page's earlier input would wait until then.
        """
        led = {
            name: BrowserPair.led(name) if planned.kind == _PAIR else (name,)
            for name, planned in plan.participants.items()
            if planned.kind in (_KIND, _PAIR) and planned.host.startswith("remote/")
        }
        self._pilots.keep([hand for hands in led.values() for hand in hands])
        for name, hands in led.items():
            self._endpoints[name] = endpoint
            held = self._threads.get(name)
            if held is None or not held.is_alive():
                self._threads[name] = threading.Thread(target=self._host, args=(name, hands), daemon=True)
                self._threads[name].start()

    def _host(self, name: str, hands: tuple[str, ...]) -> None:
        for hand in hands:
            hand_of(hand).served = True
        request = JoinRequest(host=f"remote/{name}", pid=os.getpid())
        host = DeviceHost(name, lambda: reach(self._endpoints[name], name), Keys("*"), request, None)
        host.joined = partial(self._offer, hands)
        try:
            host.serve(self._check)
        except TrocarError as error:
            log.warning("'%s' cannot be led from pages of this server: %s", name, error)
        except _StopError:
            log.debug("'%s' is no longer hosted", name)

    def _offer(self, hands: tuple[str, ...]) -> None:
        for name in hands:
            self._pilots.offer(name, _offer_of(name))

    def _check(self) -> None:
        if self._ending.is_set():
            raise _StopError

    def close(self) -> None:
        """Let go of all devices."""
        self._ending.set()
        for thread in self._threads.values():
            thread.join(_PATIENCE_S)


def _offer_of(device: str) -> Offer:
    hand = hand_of(device)
    return Offer(partial(_give_hand, device), lambda: hand.obedience, hand.ask_for)


def _give_hand(device: str, hand: Hand | None) -> None:
    """Hand a page's wish to the device; None: no page leads. Raises MessageError for an invalid pose."""
    if hand is None:
        hand_of(device).release()
        return
    pressed = {name: getattr(hand, name) for name in ("dead_man", "jaw", "pedal", "rinse")}
    wish = Wish(hand.linear, hand.angular, hand.gripper, turn=hand.turn, **pressed)
    hand_of(device).give(PageInput(wish, hand.drag, _tracked_pose(hand), hand.away))


def _tracked_pose(hand: Hand) -> tuple[Vector3, Quaternion] | None:
    """Return where a headset has the head or hand, in the axes of REP 103."""
    if hand.tracked is None:
        return None
    try:
        return vector(*hand.tracked[:3]), quaternion(*hand.tracked[3:])
    except ValueError as error:
        raise MessageError(f"not a pose: {error}") from error
