"""Draw the figures of the documentation as SVG: `python docs/tools/figures.py` writes `docs/figures/`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "figures"
TEAL, ORANGE, GREY, INK, PAPER = "#00897b", "#e65100", "#90a4ae", "#263238", "#ffffff"
LIGHT = {TEAL: "#e0f2f1", ORANGE: "#fff3e0", GREY: "#eceff1", INK: "#eceff1"}


class Figure:
    """An SVG drawing in pixels, y downwards."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self.size = (width, height)
        self.title = title
        self.parts: list[str] = []

    def box(self, x: float, y: float, w: float, h: float, text: str = "", colour: str = INK) -> None:
        """Draw a rounded box with a text of one or more lines in its middle."""
        self.parts.append(
            f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="6" fill="{LIGHT[colour]}"'
            f' stroke="{colour}" stroke-width="1.5"/>'
        )
        lines = text.split("\n") if text else []
        for i, line in enumerate(lines):
            self.text(x + w / 2, y + h / 2 + 5 + 18 * (i - (len(lines) - 1) / 2), line, bold=i == 0)

    def text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        anchor: str = "middle",
        colour: str = INK,
        size: int = 14,
        bold: bool = False,
    ) -> None:
        """Write one line; `anchor` is start, middle or end."""
        weight = ' font-weight="600"' if bold else ""
        self.parts.append(
            f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" fill="{colour}" font-size="{size}"{weight}>'
            f"{escape(text)}</text>"
        )

    def line(
        self, points: Sequence[tuple[float, float]], colour: str = INK, *, width: float = 1.5, dash: str = ""
    ) -> None:
        """Draw a line through points."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashes}/>'
        )

    def arrow(
        self,
        x0: float,
        y0: float,
        x1: float,
        y1: float,
        text: str = "",
        colour: str = INK,
        *,
        both: bool = False,
        width: float = 1.5,
        shift: tuple[float, float] = (0, -7),
        anchor: str = "middle",
    ) -> None:
        """Draw an arrow, with a text beside its middle."""
        self.line([(x0, y0), (x1, y1)], colour, width=width)
        self._head(x0, y0, x1, y1, colour)
        if both:
            self._head(x1, y1, x0, y0, colour)
        if text:
            x, y = (x0 + x1) / 2 + shift[0], (y0 + y1) / 2 + shift[1]
            self.text(x, y, text, colour=colour, size=13, anchor=anchor)

    def _head(self, x0: float, y0: float, x1: float, y1: float, colour: str) -> None:
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        points = [
            (x1, y1),
            (x1 - 10 * ux - 5 * uy, y1 - 10 * uy + 5 * ux),
            (x1 - 10 * ux + 5 * uy, y1 - 10 * uy - 5 * ux),
        ]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.parts.append(f'<polygon points="{path}" fill="{colour}"/>')

    def svg(self) -> str:
        """Return the drawing as a file's text."""
        width, height = self.size
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}"'
            f' height="{height}" role="img" font-family="Helvetica, Arial, sans-serif">'
        )
        background = "" if width == 64 else f'<rect width="{width}" height="{height}" fill="{PAPER}"/>'
        return "\n".join([head, f"<title>{escape(self.title)}</title>", background, *self.parts, "</svg>\n"])


def overview() -> Figure:
    """Draw hub, hosts and devices."""
    f = Figure(860, 400, "A session: devices, hub, and hosts with engines and controllers")
    for i, name in enumerate(
        ["haptic stylus\nWindows or Linux", "ROS console\nCRTK topics", "headset\nOpenXR"]
    ):
        f.box(40 + 270 * i, 20, 240, 56, name, GREY)
        f.arrow(160 + 270 * i, 78, 330 + 100 * i, 128, colour=GREY, both=True)
    f.text(342, 98, "samples in, contact out", size=12)
    f.box(230, 130, 400, 76, "hub\ninlets, clock, energy books, recorder, router", TEAL)
    f.arrow(330, 208, 200, 270, "grant", TEAL, shift=(-24, -4))
    f.arrow(230, 270, 360, 208, "ack", TEAL, shift=(26, 8))
    f.arrow(530, 208, 650, 270, "grant", TEAL, shift=(28, -4))
    f.arrow(620, 270, 500, 208, "ack", TEAL, shift=(-24, 8))
    f.box(40, 272, 330, 90, "", GREY)
    f.text(205, 292, "host: hub", size=12)
    f.box(56, 302, 140, 46, "teleoperation\ncontroller", INK)
    f.arrow(198, 325, 216, 325)
    f.box(218, 302, 140, 46, "robot\nMuJoCo", INK)
    f.box(572, 272, 248, 90, "", GREY)
    f.text(696, 292, "host: tissue", size=12)
    f.box(626, 302, 140, 46, "tissue\nBullet", INK)
    f.arrow(372, 325, 570, 325, "bond: pose, twist / wrench", ORANGE, both=True, width=2.5)
    f.text(471, 346, "peer to peer, energy book", size=12, colour=ORANGE)
    f.text(
        430, 388, "MCAP recording: all that enters is in the grants, so the grants determine the run", size=13
    )
    return f


def step() -> Figure:
    """Draw one communication step."""
    f = Figure(860, 310, "One communication step of length H")
    rows = {"device": 50, "hub": 110, "robot": 180, "tissue": 250}
    for name, y in rows.items():
        f.text(70, y + 5, name, anchor="end", bold=True)
        f.line([(85, y), (835, y)], GREY, width=1)
    for x, label in ((200, "t"), (620, "t + H")):
        f.line([(x, 25), (x, 275)], GREY, width=1, dash="4 4")
        f.text(x, 298, label)
    for i in range(9):
        x = 100 + 52 * i
        f.parts.append(f'<circle cx="{x}" cy="50" r="4" fill="{GREY}"/>')
    f.text(835, 40, "samples at the device's own rate", anchor="end", size=13)
    f.arrow(152, 54, 196, 104, "newest sample", TEAL, shift=(-12, 10), anchor="end")
    f.box(190, 98, 20, 24, "", TEAL)
    f.text(218, 101, "inlets sampled", anchor="start", size=13, colour=TEAL)
    f.arrow(210, 122, 250, 176, "grant", TEAL, shift=(26, 0))
    f.arrow(204, 122, 244, 232, colour=TEAL)
    f.box(250, 166, 190, 28, "sub-steps", INK)
    f.box(250, 236, 130, 28, "sub-steps", INK)
    f.arrow(382, 238, 430, 196, "mean force", ORANGE, shift=(-8, 4), anchor="end")
    f.arrow(440, 174, 600, 120, "ack with state hash", TEAL, shift=(10, 32), anchor="start")
    f.arrow(380, 256, 606, 124, colour=TEAL)
    f.box(610, 98, 20, 24, "", TEAL)
    f.text(638, 101, "next grant", anchor="start", size=13, colour=TEAL)
    return f


def periods() -> Figure:
    """Draw participants with different periods, and windows."""
    f = Figure(860, 250, "Periods are multiples of the step; grants end where a device enters")
    rows = [("robot, 1 ms", 60, 1), ("teleoperation, 4 ms", 110, 4), ("camera, 8 ms", 160, 8)]
    for name, y, n in rows:
        f.text(170, y + 5, name, anchor="end", bold=True)
        for k in range(0, 16, n):
            f.box(185 + 40 * k + 1, y - 14, 40 * n - 2, 28, "", TEAL if n == 1 else INK if n == 4 else GREY)
    f.text(170, 215, "grants", anchor="end", bold=True)
    for k in range(4):
        f.box(185 + 160 * k + 1, 197, 158, 28, "grant: 4 steps", ORANGE)
    for k in range(0, 17, 4):
        f.line([(185 + 40 * k, 35), (185 + 40 * k, 228)], ORANGE, width=1, dash="3 4")
        f.text(185 + 40 * k, 28, f"{k} ms", size=12)
    f.text(505, 245, "the stylus is read every 4 ms, so a grant may cover 4 steps: window: 4", size=13)
    return f


def bond() -> Figure:
    """Draw the exchange of a power bond."""
    f = Figure(860, 300, "The default coupling: predicted motion one way, mean force the other")
    f.box(40, 70, 250, 120, "motion side: robot\napplies the mean force\nbooks the work it gives", TEAL)
    f.box(
        570, 70, 250, 120, "force side: tissue\nspring and damper to a proxy\nbooks the work it gets", ORANGE
    )
    f.arrow(292, 100, 568, 100, "1. position and velocity at t", TEAL, width=2)
    f.text(430, 122, "predicted as x + v t inside the step", size=12, colour=TEAL)
    f.arrow(568, 160, 292, 160, "2. mean force over the step", ORANGE, width=2)
    f.text(430, 182, "applied over the same step", size=12, colour=ORANGE)
    f.box(300, 222, 260, 56, "energy book of the hub\nwork got minus work given, J", GREY)
    f.arrow(165, 192, 298, 246, "ack", GREY, shift=(-12, 10))
    f.arrow(695, 192, 562, 246, "ack", GREY, shift=(12, 10))
    f.text(
        430,
        40,
        "Action equals reaction in impulse, without iteration and without rollback",
        size=14,
        bold=True,
    )
    return f


ERRORS = {
    "jacobi": (GREY, (0.188, 0.0278, 0.0135)),
    "gauss-seidel, force first": (INK, (0.0383, 0.0072, 0.0036)),
    "impulse": (TEAL, (0.00617, 0.00109, 5.4e-4)),
    "impulse, slope": (ORANGE, (0.00118, 3.8e-5, 8.0e-6)),
}
"""RMS error of x1 in m at H = 10, 2, 1 ms: `bench/two_mass.py`, the table of decision 4."""


def coupling_error() -> Figure:
    """Draw the error of the algorithms against the communication step, both logarithmic."""
    f = Figure(860, 400, "Error of the coupling algorithms against the communication step")

    def px(h: float) -> float:
        return 110 + 480 * math.log10(h) / 1.0

    def py(error: float) -> float:
        return 40 + 300 * (math.log10(error) - 0) / -6.0

    for k in range(7):
        f.line([(110, py(10**-k)), (590, py(10**-k))], "#cfd8dc", width=1)
        f.text(100, py(10**-k) + 5, "1 m" if k == 0 else f"1e-{k} m", anchor="end", size=12)
    for h in (1, 2, 5, 10):
        f.line([(px(h), 40), (px(h), 340)], "#cfd8dc", width=1)
        f.text(px(h), 360, f"{h} ms", size=12)
    for name, (colour, errors) in ERRORS.items():
        points = [(px(h), py(e)) for h, e in zip((10, 2, 1), errors, strict=True)]
        f.line(points, colour, width=2.5)
        for x, y in points:
            f.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>')
        f.text(602, points[0][1] + 5, name, anchor="start", colour=colour, size=14, bold=True)
    f.text(350, 390, "communication step H", size=13)
    f.text(350, 22, "RMS error of the position over 2 s, two masses and a spring-damper", size=14, bold=True)
    return f


def recording() -> Figure:
    """Draw what a recording holds and what is made of it."""
    f = Figure(860, 330, "A recording holds the grants; from them every state hash follows again")
    f.box(40, 110, 150, 60, "trocar run\n--record DIR", TEAL)
    f.arrow(192, 140, 248, 140)
    f.box(250, 40, 250, 210, "", GREY)
    f.text(375, 62, "DIR: a rosbag2 directory", bold=True)
    for i, text in enumerate(
        [
            "scenario, plan, versions",
            "grants: all that entered",
            "acks: state hashes",
            "values of the outputs",
        ]
    ):
        f.box(266, 76 + 42 * i, 218, 34, "", TEAL if i == 1 else GREY)
        f.text(375, 98 + 42 * i, text, size=13)
    targets = [
        ("trocar verify", "re-simulates, compares every hash"),
        ("trocar report", "one HTML page of plots"),
        ("trocar replay", "publishes it again"),
        ("trocar ros bag", "a bag with ROS names"),
        ("Foxglove, mcap, ros2 bag", "open it as it is"),
    ]
    for i, (name, what) in enumerate(targets):
        y = 24 + 52 * i
        f.arrow(502, 140, 568, y + 20, colour=GREY)
        f.box(570, y, 262, 44, f"{name}\n{what}", TEAL if i == 0 else GREY)
    f.text(430, 312, "Same grants, same packages, same kind of processor: the same bits.", size=14, bold=True)
    return f


def safety() -> Figure:
    """Draw the chain of limits and what silence of the simulation does."""
    f = Figure(860, 400, "The chain that every force passes, and the gain after the last contact model")
    steps = [
        "finite\nnumbers",
        "silence",
        "dead-man\ncalibration",
        "speed of\nthe hand",
        "norm\n2 N",
        "ramp\n1 s",
        "slew\n0.1 N/ms",
    ]
    f.text(44, 24, "contact model, rendered at 1 kHz", anchor="start", size=13)
    for i, text in enumerate(steps):
        x = 40 + 114 * i
        f.box(x, 34, 92, 52, text, ORANGE if i in (1, 2, 3) else TEAL)
        if i < len(steps) - 1:
            f.arrow(x + 93, 60, x + 113, 60)
    f.text(820, 106, "to the motors", anchor="end", size=13)

    def px(ms: float) -> float:
        return 110 + 4.2 * ms

    def py(gain: float) -> float:
        return 340 - 180 * gain

    for gain in (0.0, 0.5, 1.0):
        f.line([(px(0), py(gain)), (px(160), py(gain))], "#cfd8dc", width=1)
        f.text(100, py(gain) + 5, f"{100 * gain:.0f} %", anchor="end", size=12)
    for ms in (0, 50, 100, 130, 150):
        f.line([(px(ms), py(0)), (px(ms), py(0) + 5)], GREY)
        f.text(px(ms), 362, f"{ms} ms", size=12)
    gain: Callable[[float], float] = lambda ms: 1.0 if ms <= 100 else math.exp(-(ms - 100) / 20)  # noqa: E731
    f.line(
        [*((px(ms), py(gain(ms))) for ms in range(131)), (px(130), py(0)), (px(160), py(0))],
        ORANGE,
        width=2.5,
    )
    f.line([(px(150), py(0)), (px(150), py(1.0))], INK, dash="4 4")
    f.text(px(150) + 8, py(0.85), "promise: zero", anchor="start", size=13)
    f.text(px(150) + 8, py(0.85) + 18, "within 150 ms", anchor="start", size=13)
    f.text(430, 390, "time since the last contact model arrived", size=13)
    f.text(
        px(4),
        py(1.0) - 10,
        "share of the force that reaches the hand",
        anchor="start",
        size=13,
        colour=ORANGE,
    )
    return f


def rooms() -> Figure:
    """Draw the packages and who imports whom."""
    f = Figure(860, 440, "Packages and the direction of imports")
    f.box(330, 380, 200, 44, "schemas", TEAL)
    f.box(30, 290, 220, 52, "robots\ndVRK numbers, kinematics", TEAL)
    f.box(330, 290, 200, 52, "hub.participant\nthe plug-in interface", ORANGE)
    f.box(560, 110, 270, 232, "", GREY)
    f.text(695, 132, "the other rooms of hub", bold=True)
    for i, text in enumerate(
        [
            "command_line, doctor, verify, testing",
            "session",
            "hosting, devices, remote",
            "recording, observation, security",
            "transport, planning",
        ]
    ):
        f.box(574, 146 + 38 * i, 242, 30, "", GREY)
        f.text(695, 166 + 38 * i, text, size=13)
    f.box(40, 130, 130, 52, "engines", INK)
    f.box(190, 130, 130, 52, "controllers", INK)
    f.box(340, 130, 130, 52, "devices", INK)
    f.box(190, 20, 280, 52, "trocar\nthe public door", ORANGE)
    for x in (105, 255, 405):
        f.arrow(x, 182, 380 + 0.3 * (x - 255), 288)
        f.arrow(x, 182, 140 + 0.3 * (x - 255), 288)
    f.arrow(140, 342, 360, 380)
    f.arrow(430, 342, 430, 378)
    f.arrow(558, 316, 532, 316)
    f.arrow(640, 342, 500, 380)
    f.arrow(470, 46, 640, 108)
    f.arrow(558, 190, 472, 160, colour=GREY)
    f.text(552, 122, "found by entry points", anchor="end", size=13, colour=GREY)
    f.text(255, 102, "plug-ins of other packages import trocar alone", size=13, colour=ORANGE)
    return f


def mark() -> Figure:
    """Draw the mark: a port in a surface and the instrument through it."""
    f = Figure(64, 64, "Trocar")
    f.parts += [
        f'<circle cx="32" cy="32" r="32" fill="{TEAL}"/>',
        '<path d="M8 40 Q32 26 56 40" fill="none" stroke="#fff" stroke-width="5" stroke-linecap="round"/>',
        '<path d="M44 8 L24 54" stroke="#fff" stroke-width="5" stroke-linecap="round"/>',
        '<circle cx="34" cy="32" r="7" fill="none" stroke="#fff" stroke-width="4"/>',
    ]
    return f


FIGURES: dict[str, Callable[[], Figure]] = {
    "overview": overview,
    "step": step,
    "periods": periods,
    "bond": bond,
    "coupling-error": coupling_error,
    "recording": recording,
    "safety": safety,
    "rooms": rooms,
    "mark": mark,
}


def main() -> None:
    """Write all figures."""
    FOLDER.mkdir(exist_ok=True)
    for name, draw in FIGURES.items():
        (FOLDER / f"{name}.svg").write_text(draw().svg(), "utf-8")


if __name__ == "__main__":
    main()
