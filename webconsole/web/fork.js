// Forks: the form at an instant of a recording, the sessions that were started from it, and the tree.

import { pathTo } from "./address.js"
import { make } from "./started.js"

const $ = (id) => document.getElementById(id)
const SVG = "http://www.w3.org/2000/svg"
const ROW = 34, LEFT = 8, WIDTH = 560, LETTER = 6.3

export class Forks {
  constructor(link, timeline, started) {
    Object.assign(this, { link, timeline, started })
    $("fork-here").onclick = () => this.open()
    $("fork-form").onsubmit = (event) => { event.preventDefault(); this.send() }
    $("fork-close").onclick = () => $("fork").close()
    $("fork-add").onchange = () => this.add($("fork-add").value)
  }

  begin({ kind, role }) { $("fork-here").hidden = kind !== "recording" || role !== "operator" }

  async open() {
    this.timeline.pause()
    $("fork-time").value = this.timeline.time.toFixed(3)
    $("fork-time").max = this.timeline.end
    this.error("")
    $("fork").showModal()
    this.link.send({ do: "prepare" })
    if (!this.offered) await this.offer()
    await this.tree()
  }

  async offer() {
    const answer = await fetch(pathTo("/fork"))
    if (!answer.ok) { this.error(await answer.text()); return }
    const { devices, duration, parameters } = this.offered = await answer.json()
    $("fork-duration").placeholder = duration ?? "without end"
    $("fork-devices").replaceChildren(...devices.map(({ name, kind }) => make("label", {},
      make("input", { type: "checkbox", value: name, disabled: kind === "browser", checked: kind === "browser" }),
      ` ${name} (${kind}) is led from the page`)))
    $("fork-add").append(...parameters.map((text) => new Option(text, text)))
  }

  add(text) {
    const lines = $("fork-changes")
    if (text) lines.value = `${lines.value.trimEnd()}\n${text}`.trimStart()
    $("fork-add").value = ""
    lines.focus()
  }

  send() {
    this.error("")
    const duration = $("fork-duration").value
    this.link.send({
      do: "fork",
      time: Number($("fork-time").value),
      changes: Object.fromEntries($("fork-changes").value.split("\n").filter((line) => line.trim()).map(change)),
      lead: [...$("fork-devices").querySelectorAll("input:checked:enabled")].map(({ value }) => value),
      duration: duration === "" ? null : Number(duration),
      pace: $("fork-pace").value || null,
      record: $("fork-record").checked,
    })
    $("fork-go").disabled = true
  }

  answered({ to, error, number }) {
    if (to !== "fork") return
    if (error) this.failed(error)
    else this.started.follow(number, (text) => this.failed(text))
  }

  failed(text) {
    this.error(text)
    $("fork-go").disabled = false
  }

  error(text) {
    $("fork-error").textContent = text
    $("fork-error").hidden = !text
  }

  async tree() {
    const answer = await fetch(pathTo("/forks"))
    if (answer.ok) $("fork-tree").replaceChildren(drawn(await answer.json()))
  }
}

// `participant.parameter=value` as path and value of JSON; what is no number is a word.
function change(line) {
  const [path, ...rest] = line.split("="), text = rest.join("=").trim()
  try { return [path.trim(), JSON.parse(text)] } catch { return [path.trim(), text] }
}

// A line for each recording over simulated time; a fork hangs on its parent where it leaves it.
function drawn(members) {
  const svg = document.createElementNS(SVG, "svg")
  const longest = Math.max(...members.map(({ end }) => end), 1e-3), parents = []
  const x = (time) => LEFT + (time / longest) * (WIDTH - 2 * LEFT)
  const put = (name, attributes, text = "") => {
    const element = document.createElementNS(SVG, name)
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value)
    element.textContent = text
    svg.append(element)
  }
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${ROW * members.length + 4}`)
  svg.setAttribute("role", "img")
  svg.setAttribute("aria-label", members.map(({ name, at, changes }) =>
    at == null ? name : `${name}, forked at ${at} s: ${changes.join(", ") || "nothing"} changed`).join("; "))
  members.forEach(({ name, depth, end, at, changes, shown }, row) => {
    const y = ROW * row + 25, from = depth ? at : 0, parent = depth ? parents[depth - 1] : null
    parents[depth] = y
    if (parent != null) put("path", { d: `M${x(from)} ${parent}V${y}`, class: "branch" })
    put("path", { d: `M${x(from)} ${y}H${x(end)}`, class: shown ? "run shown" : "run" })
    put("circle", { cx: x(end), cy: y, r: 3.5, class: shown ? "shown" : "" })
    const said = at == null ? `${end.toFixed(2)} s` : `from ${at.toFixed(3)} s: ${changes.join(", ") || "nothing changed"}`
    const text = `${name}  ${said}`, right = x(from) + text.length * LETTER > WIDTH
    put("text", { x: right ? WIDTH - LEFT : x(from) + 4, y: y - 6, "text-anchor": right ? "end" : "start" }, text)
  })
  return svg
}
