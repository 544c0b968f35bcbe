// The timeline of a recording, or of a running session that is recorded: the instant that is shown, playing,
// events, and of a recording the instant in the URL.

import { pathTo } from "./address.js"

const $ = (id) => document.getElementById(id)

const MOST_EVENTS = 500
const LEVELS = { warn: "--warn", error: "--bad" }

export class Timeline {
  constructor(show) {
    this.show = show // (time) => asks for it; null: what runs now
    this.live = false
    this.past = true // an instant is shown, and not what runs now
    this.time = this.start = this.end = 0
    this.events = []
    this.others = [] // of a recording beside this one
    this.playing = false
    this.scrub = $("scrub")
    this.scrub.addEventListener("input", () => { this.pause(); this.go(Number(this.scrub.value)) })
    $("play").onclick = () => this.toggle()
    $("previous").onclick = () => this.jump(-1)
    $("next").onclick = () => this.jump(1)
    $("now").onclick = () => this.now()
    // by now the page itself may have named another instant
    addEventListener("hashchange", ({ newURL }) => this.fromUrl(new URL(newURL).hash))
    addEventListener("keydown", (event) => this.key(event))
    new ResizeObserver(() => this.marks()).observe($("marks"))
  }

  async begin(start, end) {
    if (this.begun) return
    this.begun = true
    Object.assign(this, { start, end })
    this.scrub.min = start; this.scrub.max = end
    $("timeline").hidden = false
    if (!this.fromUrl()) this.go(start)
    const answer = await fetch(pathTo("/events"))
    if (answer.ok) this.events = await answer.json()
    this.found?.(this.events)
    this.marks()
  }

  // Another recording is shown beside this one, until a later time.
  extend(end) {
    this.end = Math.max(this.end, end)
    this.scrub.max = this.end
    this.marks()
  }

  beside(events) {
    this.others = events
    this.found?.(events)
    this.marks()
  }

  // Another session runs, and nothing of its past is known yet.
  reset() {
    Object.assign(this, { live: true, past: false, begun: false, playing: false, time: null, events: [], others: [] })
    $("timeline").hidden = true
    this.say()
  }

  // What is recorded of the running session by now. Who leads a device sees what runs now.
  grow({ start, end, log }, leading) {
    this.events.push(...log ?? [])
    this.events.splice(0, this.events.length - MOST_EVENTS)
    this.leading = leading
    if (start == null || end <= start) return
    Object.assign(this, { start, end, begun: true })
    $("timeline").hidden = $("now").hidden = false
    this.scrub.min = start; this.scrub.max = end
    for (const id of ["scrub", "play", "previous", "next"]) $(id).disabled = leading
    if (leading && this.past) this.now()
    if (this.past) this.scrub.value = this.time
    else this.scrub.value = end
    this.say()
    this.marks()
  }

  now() {
    Object.assign(this, { past: false, playing: false, time: null })
    $("play").textContent = "Play"
    this.scrub.value = this.end
    this.say()
    this.show(null)
  }

  say() {
    const text = this.past ? `${this.time.toFixed(3)} s` : "now"
    $("instant").textContent = this.live && this.past ? `past: ${text}` : text
    $("now").disabled = !this.past
    document.body.classList.toggle("past", this.live && this.past)
    this.scrub.setAttribute("aria-valuetext", this.past ? `${this.time.toFixed(3)} seconds` : "now")
  }

  fromUrl(hash = location.hash) {
    if (this.live) return false
    const given = Number(new URLSearchParams(hash.slice(1)).get("t") ?? NaN)
    if (!this.begun || Number.isNaN(given) || Math.abs(given - this.time) < 5e-4) return !Number.isNaN(given)
    this.go(given)
    clearTimeout(this.naming)
    this.name() // at once: what the page itself was about to name may have taken its place
    return true
  }

  go(time) {
    this.time = Math.min(Math.max(time, this.start), this.end)
    this.past = true
    this.scrub.value = this.time
    this.say()
    this.show(this.time)
    clearTimeout(this.naming)
    if (!this.playing && !this.live) this.naming = setTimeout(() => this.name(), 150)
  }

  name() {
    const query = new URLSearchParams(location.hash.slice(1))
    query.set("t", this.time.toFixed(3))
    history.replaceState(null, "", `#${query}`)
  }

  toggle() { if (this.playing) this.pause(); else this.play() }

  play() {
    if (!this.past || this.time >= this.end) this.go(this.start)
    this.playing = true
    this.last = performance.now()
    $("play").textContent = "Pause"
  }

  pause() {
    this.playing = false
    $("play").textContent = "Play"
    if (!this.live) this.name()
  }

  // Called at each drawing.
  tick(now) {
    if (!this.playing) return
    const time = this.time + ((now - this.last) / 1000) * Number($("speed").value)
    this.last = now
    this.go(time)
    if (this.time >= this.end) { if (this.live) this.now(); else this.pause() }
  }

  jump(way) {
    this.pause()
    const times = [...this.events, ...this.others].map(({ time }) => time).sort((a, b) => a - b), from = this.past ? this.time : Infinity
    const found = way > 0 ? times.find((t) => t > from + 1e-6) : times.findLast((t) => t < from - 1e-6)
    if (found != null) this.go(found)
  }

  key(event) {
    if (!this.begun || this.leading || event.target.closest("input:not([type=range]), select, button")) return
    const act = { " ": () => this.toggle(), "[": () => this.jump(-1), "]": () => this.jump(1) }[event.key]
    if (!act) return
    event.preventDefault()
    if (!(event.repeat && event.key === " ")) act() // space is still held after a lead that was lost
  }

  marks() {
    const canvas = $("marks"), { clientWidth: width, clientHeight: height } = canvas
    if (!width) return
    canvas.width = width * devicePixelRatio; canvas.height = height * devicePixelRatio
    const context = canvas.getContext("2d"), style = getComputedStyle(document.documentElement)
    context.scale(devicePixelRatio, devicePixelRatio)
    for (const { time, level, recording } of [...this.events, ...this.others]) {
      const own = recording == null
      context.fillStyle = style.getPropertyValue(level !== "info" ? LEVELS[level] : own ? "--soft" : "--other")
      const share = (time - this.start) / (this.end - this.start || 1)
      context.fillRect(8 + share * (width - 16) - 1, own ? 2 : height - 9, 2, 7) // the thumb of the range is 16 px wide
    }
  }
}
