// Driving: keys, a pad for the pointer and a gamepad lead one device, while this page is in front of its person.
//
// Inputs are sent by a timer of their own and at each change, whatever the drawing takes. When the page loses the
// focus or is hidden, everything is let go and nothing more is sent: the device falls silent and the arm holds.

import { filled } from "./enlarge.js"

const KEYS = {
  w: ["ahead", { linear: [1, 0, 0] }], s: ["back", { linear: [-1, 0, 0] }],
  a: ["left", { linear: [0, 1, 0] }], d: ["right", { linear: [0, -1, 0] }],
  r: ["up", { linear: [0, 0, 1] }], f: ["down", { linear: [0, 0, -1] }],
  arrowup: ["point up", { turn: [0, -1, 0] }], arrowdown: ["point down", { turn: [0, 1, 0] }],
  arrowleft: ["point left", { turn: [0, 0, 1] }], arrowright: ["point right", { turn: [0, 0, -1] }],
  q: ["roll left", { angular: [0, 0, -1] }], e: ["roll right", { angular: [0, 0, 1] }],
  " ": ["hold to move", { dead_man: true }], shift: ["slowly", {}],
  c: ["close", { gripper: -1, jaw: true }], v: ["open", { gripper: 1 }],
  x: ["power, suction", { pedal: true }], z: ["saline", { rinse: true }],
}
const PEDALS = { x: "pedal", z: "rinse" } // shown where the instruments of the led arm have them
const CAPS = { " ": "space", arrowup: "↑", arrowdown: "↓", arrowleft: "←", arrowright: "→" }
// Why a device holds (devices/browser/page_hand.py), and what to do.
const WHY = {
  unled: "the device waits for this page",
  open: "press space, and hold it, to move",
  silent: "this page was late; the arm goes on in a moment",
  spent: "this page was silent for too long; let go of space, and press it again",
}
const PERIOD_MS = 25
const SLOWLY = 0.2 // share of the speed of keys while Shift is held
const PAD_M_PER_PX = 0.0005
const LATE_MS = 300 // an arm that does not follow for so long is said
const DEAD_ZONE = 0.24 // of a stick at rest (XINPUT_GAMEPAD_LEFT_THUMB_DEADZONE, 7849 of 32767)

export class Pilot {
  constructor(panel, link, feel) {
    Object.assign(this, { panel, link, feel })
    this.device = null
    this.number = 0
    this.held = new Set()
    this.drag = [0, 0, 0]
    this.dragging = false
    this.text = ""
    this.instruments = [] // of each arm that may get others from this page: device, arm, instruments
    this.pedals = {} // of each device: buttons that do something at the instrument, "pedal" or "rinse"
    this.led = {} // of each device that this page leads: how it follows, and what keeps an arm from following it
    this.pill = pill()
    addEventListener("keydown", (event) => this.key(event, true))
    addEventListener("keyup", (event) => this.key(event, false))
    addEventListener("blur", () => this.letGo())
    addEventListener("change", ({ target }) => { if (this.leading) target.blur?.() }) // the keys lead on
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.letGo() })
    setInterval(() => this.send(), PERIOD_MS)
  }

  get leading() { return this.device != null }

  // `devices`: [{ device, pilot }] as the server sees them; `state`: that of the session.
  show(devices, role, state) {
    this.state = state
    const mine = devices?.find(({ pilot }) => pilot === "you")?.device ?? null
    if (mine !== this.device) this.become(mine)
    this.panel.hidden = !devices?.length || role === "viewer"
    const text = JSON.stringify([devices, role, this.instruments])
    if (text === this.text || this.panel.hidden) return
    this.text = text
    this.build(devices)
  }

  become(device) {
    this.device = device
    this.drag = [0, 0, 0]
    this.held.clear()
    if (!this.leading) this.pill.remove()
    document.body.classList.toggle("leading", this.leading)
  }

  build(devices) {
    this.panel.classList.toggle("leading", this.leading)
    const rows = devices.map(({ device, pilot }) => {
      const row = element("span", "row"), button = element("button")
      button.textContent = pilot === "you" ? `Leave ${device}` : `Lead ${device}`
      button.disabled = Boolean(pilot) && pilot !== "you"
      button.title = button.disabled ? `${pilot} leads ${device}, and must leave it first` : ""
      button.onclick = () => {
        button.blur() // the space bar is the dead-man from here on
        this.link.send(pilot === "you" ? { do: "leave" } : { do: "lead", device })
      }
      const who = element("span")
      who.textContent = pilot === "you" ? "you lead it" : pilot ? `${pilot} leads it` : this.leading ? "" : "no page leads it"
      row.append(button, who)
      return row
    })
    if (!this.leading) return this.panel.replaceChildren(...rows)
    this.first = element("div", "row")
    this.first.append(...rows)
    this.panel.replaceChildren(this.first, ...this.exchange(), this.help())
    this.mark()
  }

  // What the led arm may hold, each with its key.
  get offered() { return this.instruments.find(({ device }) => device === this.device) }

  exchange() {
    if (!this.offered) return []
    const row = element("div", "row"), arm = element("span")
    arm.textContent = `${this.offered.arm} gets`
    row.append(arm, ...this.offered.instruments.map((instrument, i) => {
      const button = element("button"), cap = element("kbd")
      cap.textContent = cap.dataset.key = String(i + 1)
      button.append(cap, ` ${wordsOf(instrument)}`)
      button.onclick = () => { button.blur(); this.get(i) }
      return button
    }))
    return [row]
  }

  get(number) {
    const instrument = this.offered?.instruments[number]
    if (instrument) this.link.send({ do: "exchange", device: this.device, instrument })
  }

  help() {
    const keys = element("div", "keys")
    for (const [key, [text]] of Object.entries(KEYS)) {
      if (key in PEDALS && !this.pedals[this.device]?.includes(PEDALS[key])) continue
      const one = element("span"), cap = element("kbd")
      cap.dataset.key = key
      cap.textContent = CAPS[key] ?? key
      one.append(cap, ` ${text}`)
      keys.append(one)
    }
    const pad = element("div")
    pad.id = "pad"
    pad.setAttribute("role", "application")
    pad.setAttribute("aria-label", "Pad: drag to move the instrument sideways and up; with Shift ahead")
    pad.textContent = "drag to move; Shift: ahead"
    this.listen(pad)
    const row = element("div", "row")
    row.append(pad, keys)
    return row
  }

  listen(pad) {
    let last = null
    pad.onpointerdown = (event) => {
      pad.setPointerCapture(event.pointerId)
      last = [event.clientX, event.clientY]
      this.dragging = true
      this.send()
    }
    pad.onpointermove = (event) => {
      if (!this.dragging || !last) return
      const x = (event.clientX - last[0]) * PAD_M_PER_PX, y = (event.clientY - last[1]) * PAD_M_PER_PX
      last = [event.clientX, event.clientY]
      this.drag = event.shiftKey
        ? [this.drag[0] - y, this.drag[1] - x, this.drag[2]]
        : [this.drag[0], this.drag[1] - x, this.drag[2] - y]
    }
    pad.onpointerup = pad.onpointercancel = pad.onlostpointercapture = () => {
      last = null
      this.dragging = false
      this.send()
    }
  }

  key(event, down) {
    const key = event.key.toLowerCase()
    if (!this.leading || event.ctrlKey || event.metaKey || event.altKey) return
    if (event.target.closest?.("input, select")) return
    if (down && !event.repeat && /^[1-9]$/.test(key)) this.get(Number(key) - 1)
    if (!(key in KEYS)) return
    event.preventDefault()
    if (event.repeat) return
    if (down) this.held.add(key)
    else this.held.delete(key)
    this.send()
  }

  letGo() {
    if (!this.leading) return
    this.held.clear()
    this.dragging = false
    this.gizmo?.letGo()
    this.send(true)
  }

  lost() { this.become(null) }

  answered({ to, device, error }) { if (to === "lead" && !error) this.become(device) }

  pad() {
    return [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected && one.mapping === "standard")
  }

  wish() {
    const wish = { linear: [0, 0, 0], angular: [0, 0, 0], turn: [0, 0, 0], gripper: 0, dead_man: this.dragging, jaw: false, pedal: false, rinse: false }
    const add = (one, speed = 1) => {
      for (const name of ["linear", "angular", "turn"]) one[name]?.forEach((share, i) => { wish[name][i] += speed * share })
      wish.gripper += speed * (one.gripper ?? 0)
      for (const name of ["dead_man", "jaw", "pedal", "rinse"]) wish[name] ||= one[name] ?? false
    }
    for (const key of this.held) add(KEYS[key][1], this.held.has("shift") ? SLOWLY : 1)
    const pad = this.pad()
    if (pad) add(gamepad(pad))
    if (this.gizmo) add(this.gizmo.wish())
    const limit = (share) => Math.min(Math.max(share, -1), 1)
    return { ...wish, linear: wish.linear.map(limit), angular: wish.angular.map(limit), turn: wish.turn.map(limit), gripper: limit(wish.gripper) }
  }

  // How the devices that this page leads follow it now.
  follow(devices) {
    this.led = devices
    this.mark()
  }

  // What is let go is sent at once; then nothing is, while the page is not in front.
  send(last = false) {
    if (!this.leading || (!last && (document.hidden || !document.hasFocus()))) return
    const wish = this.wish()
    if (last) wish.dead_man = false
    this.link.send({ do: "hand", number: ++this.number, drag: this.drag, away: last, ...wish })
    this.feel.pulse(this.device, this.pad(), wish.dead_man)
    this.mark()
  }

  // The pill stands in the panel, or in the picture that has the whole screen.
  mark() {
    if (!this.leading) return
    const place = filled() ?? this.first, { pill } = this
    if (pill.parentNode !== place) place?.append(pill)
    const why = this.hindrance(), force = this.feel.force(this.device)
    const felt = force ? `, ${force.toFixed(1)} N` : ""
    const text = why ? `holding: ${why}` : `moving: dead-man held${felt}`
    if (pill.textContent !== text) pill.textContent = text
    pill.classList.toggle("held", !why)
    document.getElementById("pad")?.classList.toggle("held", this.dragging)
    for (const cap of this.panel.querySelectorAll("kbd")) cap.classList.toggle("held", this.held.has(cap.dataset.key))
  }

  // Why the arm holds, and what to do about it; null if it moves.
  hindrance() {
    const { obedience, hindrance } = this.led[this.device] ?? {}, now = performance.now()
    if (obedience !== "moves" || !hindrance) this.followed = now
    if (!document.hasFocus() || obedience === "away") return "this page is not in front; click into it"
    if (this.state === "paused") return "the session is paused; press Resume"
    if (this.state !== "running") return `the session is ${this.state}`
    if (obedience === "moves") return now - this.followed > LATE_MS ? hindrance : null
    return WHY[obedience] ?? "the device has not heard this page yet"
  }
}

// Buttons and axes of https://www.w3.org/TR/gamepad/#remapping, with the meaning they have for kind `keyboard`.
function gamepad({ axes, buttons }) {
  const axis = (i) => {
    const value = axes[i] ?? 0, beyond = Math.max(0, Math.min(Math.abs(value), 1) - DEAD_ZONE) / (1 - DEAD_ZONE)
    return value > 0 ? beyond : -beyond
  }
  const button = (i) => buttons[i]?.value ?? 0
  return {
    linear: [-axis(1), -axis(0), button(12) - button(13)],
    angular: [0, 0, button(15) - button(14)],
    turn: [0, axis(3), -axis(2)],
    gripper: button(6) - button(7), dead_man: button(4) > 0.5, jaw: button(7) > 0,
    pedal: button(5) > 0.5, rinse: button(0) > 0.5,
  }
}

// "ROUND_TIP_SCISSORS:400007[..]" in words.
function wordsOf(instrument) {
  const [name] = instrument.split(":")
  return name.toLowerCase().replaceAll("_", " ")
}

// How the arm follows, and what to press if it does not.
function pill() {
  const pill = element("span", "pill")
  pill.id = "dead-man"
  pill.setAttribute("role", "status")
  return pill
}

function element(name, className = "") {
  const made = document.createElement(name)
  if (className) made.className = className
  return made
}
