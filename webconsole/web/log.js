// The log: what happened, with warnings that cannot be overlooked. It follows the instant that is shown.

import { counted } from "./words.js"

const KEPT = 2000
const RANKS = { info: 0, warn: 1, error: 2 }
const LOWEST_PX = 38, STEP_PX = 17, HEIGHT = "trocar-log-height"
const $ = (id) => document.getElementById(id)

export class Log {
  constructor(lines, worst, chosen) {
    Object.assign(this, { lines, worst, chosen })
    this.clear()
    for (const id of ["log-level", "log-source", "log-text"]) $(id).addEventListener("input", () => this.filter())
    this.edge = $("log-edge")
    let from = 0 // where the pointer would be at a height of zero
    this.edge.onpointerdown = ({ pointerId, clientY }) => {
      from = clientY + lines.clientHeight
      this.edge.setPointerCapture(pointerId)
    }
    this.edge.onpointermove = ({ buttons, clientY }) => buttons && this.resize(from - clientY)
    this.edge.onkeydown = (event) => {
      const way = { ArrowUp: STEP_PX, ArrowDown: -STEP_PX }[event.key]
      if (way) { event.preventDefault(); this.resize(lines.clientHeight + way) }
    }
    const before = Number(localStorage.getItem(HEIGHT))
    if (before) this.resize(before)
  }

  clear() {
    this.rows = [] // { entry, line }, in the order of arrival
    this.warnings = 0
    this.time = this.current = null
    this.lines.replaceChildren()
    this.worst.textContent = ""
    $("log-source").replaceChildren(new Option("everybody", ""))
  }

  add(entries, jumps = false) {
    if (!entries?.length) return
    const below = this.lines.scrollHeight - this.lines.scrollTop - this.lines.clientHeight < 20
    for (const entry of entries) {
      const line = this.line(entry, jumps)
      line.hidden = !this.passes(entry)
      // events of a second recording come after those of the first: here both stand by time
      const at = jumps ? this.rows.findIndex(({ entry: { time } }) => time > entry.time) : -1
      this.lines.insertBefore(line, this.rows[at]?.line ?? null)
      this.rows.splice(at < 0 ? this.rows.length : at, 0, { entry, line })
      this.name(participant(entry))
    }
    for (const { line } of this.rows.splice(0, this.rows.length - KEPT)) line.remove()
    if (this.time != null) this.at(this.time)
    else if (below && !jumps) this.lines.scrollTop = this.lines.scrollHeight
    this.worst.textContent = this.warnings ? counted(this.warnings, "warning") : ""
  }

  line({ time, level, source, text, recording }, jumps) {
    const line = document.createElement("li")
    line.className = level
    if (recording != null) line.classList.add("other")
    if (level !== "info") this.warnings++
    const at = document.createElement("span")
    if (jumps) {
      const button = document.createElement("button")
      button.textContent = `${time.toFixed(3)} s`
      button.setAttribute("aria-label", `Go to ${time.toFixed(3)} seconds: ${text}`)
      button.onclick = () => this.chosen(time)
      at.append(button)
    } else at.textContent = `${time.toFixed(3)} s`
    const who = document.createElement("span"), what = document.createElement("span")
    who.textContent = who.title = recording == null ? source : `${recording}: ${source}`
    what.textContent = level === "info" ? text : `${level === "warn" ? "Warning" : "Error"}: ${text}`
    line.append(at, who, what)
    return line
  }

  name(who) {
    const known = $("log-source")
    if (![...known.options].some(({ value }) => value === who)) known.append(new Option(who, who))
  }

  passes(entry) {
    const words = $("log-text").value.toLowerCase(), who = $("log-source").value
    return RANKS[entry.level] >= Number($("log-level").value) && (!who || participant(entry) === who)
      && `${entry.source} ${entry.text}`.toLowerCase().includes(words)
  }

  filter() {
    for (const { entry, line } of this.rows) line.hidden = !this.passes(entry)
    this.current = null
    if (this.time != null) this.at(this.time)
    else this.lines.scrollTop = this.lines.scrollHeight
  }

  // The instant that is shown, s; null: now. What comes later is pale, the last line before it is in view.
  at(time) {
    this.time = time
    let current = null, latest = -Infinity
    for (const { entry, line } of this.rows) {
      const later = time != null && entry.time > time + 1e-6
      line.classList.toggle("later", later)
      if (!later && !line.hidden && entry.time >= latest) { current = line; latest = entry.time }
    }
    if (time == null) { this.mark(null); this.lines.scrollTop = this.lines.scrollHeight; return }
    this.mark(current)
  }

  mark(line) {
    if (line === this.current) return
    this.current?.classList.remove("current")
    this.current = line
    line?.classList.add("current")
    const { scrollTop: top, clientHeight: height } = this.lines, at = line?.offsetTop ?? 0
    if (at < top || at + (line?.offsetHeight ?? 0) > top + height) this.lines.scrollTop = at - height / 2
  }

  resize(height) {
    const fit = Math.round(Math.min(Math.max(height, LOWEST_PX), 0.6 * innerHeight))
    this.lines.style.height = `${fit}px`
    this.edge.setAttribute("aria-valuenow", fit)
    localStorage.setItem(HEIGHT, fit)
  }
}

function participant({ source }) { return source.split(".")[0] }
