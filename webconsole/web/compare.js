// A second recording beside the one that is shown: aligned at their starts, its bodies as a ghost in the same scene,
// its curves dashed in the same plots, and the differences of the results in a table.

import * as THREE from "./vendor/three.module.js"
import { compared, pageOf, pathTo, shown } from "./address.js"
import { Contents } from "./contents.js"
import { CHANGE, changeOf, FILM, filmOf, Link, nodesOf, NODES, POSES, SURFACE } from "./link.js"
import { short } from "./plots.js"
import { make } from "./started.js"

const GHOST = 0x2f7dd1, OPACITY = 0.4
const ABSENT = "not in this recording"

export class Comparison {
  // `dirty`: is called when the scene has changed; `said`: with what cannot be shown.
  constructor(section, timeline, dirty, said) {
    Object.assign(this, { section, timeline, dirty, said })
    this.span = null // start and end of the other recording, s
    this.time = null
    // Name of the other recording, and how much later its times are than those of the one that is shown, s.
    this.other = new Promise((resolve) => { this.aligned = (later) => resolve({ name: compared, later }) })
    this.link = new Link({
      opened() {}, closed() {}, refused: said, answer: ({ error }) => error && said(error), trouble: ({ text }) => said(text),
      session: (described) => this.begin(described),
      state: (state) => this.align(state),
      frame: (frame) => this.take(frame),
    }, compared)
    this.show()
  }

  // `scene`: null where the browser draws none.
  stage(scene) {
    if (!scene) return
    this.world = new THREE.Group()
    scene.world.add(this.world)
    this.ghost = new Contents(this.world, translucent)
    this.load()
  }

  begin(described) {
    this.described = described
    this.load()
  }

  async load() {
    if (!this.ghost || !this.described?.surfaces) return
    const answer = await fetch(pathTo("/scene", {}, compared))
    if (!answer.ok) return this.said(await answer.text())
    this.ghost.load(await answer.arrayBuffer(), this.described.surfaces)
    this.link.send({ do: "show", pictures: false, again: true })
    if (this.time != null) this.at(this.time)
  }

  align({ start, end }) {
    if (this.span || !this.timeline.begun) return
    this.span = [start, end]
    this.later = start - this.timeline.start
    this.timeline.extend(end - this.later)
    this.aligned(this.later)
    this.tell()
    if (this.time != null) this.at(this.time)
  }

  // The events of the other recording, at the times of the one that is shown.
  async tell() {
    const answer = await fetch(pathTo("/events", {}, compared))
    if (!answer.ok) return this.said(await answer.text())
    const events = await answer.json()
    this.timeline.beside(events.map((event) => ({ ...event, time: event.time - this.later, recording: compared })))
  }

  // The instant of the recording that is shown, s.
  at(time) {
    this.time = time
    if (this.span) this.link.send({ do: "at", time: Math.min(time + this.later, this.span[1]) })
  }

  take({ number, sections, buffer }) {
    for (const { kind, index, at, size } of this.ghost ? sections : []) {
      if (kind === POSES) this.ghost.poses(index, buffer, at, size)
      else if (kind === SURFACE) this.ghost.surface(index, new Uint32Array(buffer, at, size / 4))
      else if (kind === CHANGE) this.ghost.change(index, changeOf(buffer, at, size))
      else if (kind === FILM) this.ghost.film(index, filmOf(buffer, at, size))
      else if (kind === NODES && size) this.ghost.nodes(index, nodesOf(buffer, at, size))
    }
    this.link.acknowledge(number)
    this.dirty()
  }

  async show() {
    const seen = make("input", { type: "checkbox", checked: true })
    seen.onchange = () => this.see(seen.checked)
    const head = make("h2", {}, "Two recordings", make("a", { href: pageOf(shown), textContent: "End comparison" }))
    const both = await Promise.all([shown, compared].map(numbers))
    const names = both.map(({ name }, i) => make("span", {}, make("i", { className: ["solid", "dashed"][i] }), name))
    const ghost = make("label", { className: "check" }, seen, " ghost in the scene")
    this.section.replaceChildren(head, make("p", { className: "legend" }, ...names, ghost),
      make("div", { className: "scroll", tabIndex: 0, ariaLabel: "Results of both", role: "region" }, differences(...both)))
    this.section.hidden = false
  }

  see(whether) {
    if (this.world) this.world.visible = whether
    this.dirty()
  }
}

async function numbers(recording) {
  const answer = await fetch(pathTo("/numbers", {}, recording))
  return answer.ok ? answer.json() : { name: recording ?? "", text: await answer.text(), numbers: [] }
}

// The results of both: a row for what was done, and one for each number that one of them has.
function differences(a, b) {
  const table = make("table"), rows = new Map()
  const head = table.createTHead().insertRow()
  for (const text of ["", a.name, b.name, "difference"]) head.append(make("th", { scope: "col", textContent: text }))
  for (const [at, { numbers }] of [a, b].entries()) {
    for (const { name, value, unit, reason } of numbers) {
      if (!rows.has(name)) rows.set(name, { unit, values: [null, null], reasons: [ABSENT, ABSENT] })
      const row = rows.get(name)
      row.values[at] = value
      row.reasons[at] = reason
    }
  }
  const body = table.createTBody(), said = [a, b].map(outcome)
  if (said.some(Boolean)) body.append(make("tr", {}, ...["outcome", ...said, ""].map((text) => make("td", {}, text))))
  const both = ({ values }) => values.every((value) => value != null)
  for (const [name, { unit, values: [first, second], reasons }] of [...rows].sort(([, a], [, b]) => both(b) - both(a))) {
    if (first == null && second == null) continue
    const apart = first == null || second == null ? null : second - first
    const row = body.insertRow()
    row.insertCell().textContent = unit ? `${name} (${unit})` : name
    for (const [at, value] of [first, second].entries()) {
      row.append(make("td", { className: value == null ? "why" : "", textContent: value == null ? reasons[at] || "no value" : short(value) }))
    }
    row.insertCell().textContent = apart == null ? "" : apart === 0 ? "0" : `${apart > 0 ? "+" : "−"}${short(Math.abs(apart))}`
  }
  return table
}

function outcome({ succeeded }) { return { true: "succeeded", false: "did not succeed" }[succeeded] ?? "" }

// Behind what is at the same place in both recordings: what is equal looks as ever.
function translucent(_, side) {
  return new THREE.MeshLambertMaterial({ color: GHOST, side, transparent: true, opacity: OPACITY, depthWrite: false,
    polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8 })
}
