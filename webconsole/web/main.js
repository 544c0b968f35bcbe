// The page: it puts together link, scene, pictures, plots, log, timeline and driving.

import { ARROWS, CHANGE, changeOf, FELT, FILM, filmOf, Link, nodesOf, MARKERS, NODES, PICTURE, POSES, SAMPLE, SMOKE, SURFACE } from "./link.js"
import { compared, pathTo, shown } from "./address.js"
import { Alerts } from "./alerts.js"
import { Capture } from "./capture.js"
import { Comparison } from "./compare.js"
import { Depths } from "./depth.js"
import { Eyes } from "./eyes.js"
import { Feel } from "./feel.js"
import { Guide } from "./guide.js"
import { foldable } from "./fold.js"
import { Head } from "./head.js"
import { Headset } from "./headset.js"
import { Log } from "./log.js"
import { Network } from "./network.js"
import { Notices, markersOf } from "./notices.js"
import { Plots } from "./plots.js"
import { Recordings } from "./recordings.js"
import { Pilot } from "./pilot.js"
import { Timeline } from "./timeline.js"
import { showCard } from "./card.js"
import { Forks } from "./fork.js"
import { Start } from "./start.js"
import { Started } from "./started.js"
import { Tune } from "./tune.js"
import { cameraButtons } from "./views.js"

const $ = (id) => document.getElementById(id)
const REFRESH_MS = 100, STILL_MS = 400

let scene = null, session = null, waiting = [], drawn = 0, dirty = true, refreshed = 0

const link = new Link({
  opened() { head.banner("") },
  closed() {
    pilot.lost()
    headset.lost()
    head.banner("The server of this page does not answer. The page comes back by itself.")
    waiting = []
  },
  refused(why) { head.banner(why || "This page's server was started again. Open the link that it has printed.") },
  frame(frame) { waiting.push(frame); dirty = true },
  session: begin,
  state(state) {
    head.show(state)
    warn(state.log, new Set(state.pilots?.map(({ device }) => device.split("/")[0]))) // a pair of hands says it as one
    showCard($("card"), state.card)
    headset.show(state.pilots, session?.role)
    pilot.instruments = session?.instruments ?? []
    pilot.pedals = session?.pedals ?? {}
    pilot.show(state.pilots?.map((one) => headset.owns(one.device) ? { ...one, pilot: "the headset" } : one),
      session?.role, state.state)
    pilot.gizmo?.show(session?.dragged?.find(({ device }) => device === pilot.device) ?? null)
    network.show(state.links, session?.role)
    tune.show(state.tunables, session?.role)
    guide.show(state.guide)
    started.show(state.started)
    if (session?.kind === "recording") timeline.begin(state.start, state.end)
    else if (session) timeline.grow(state, pilot.leading || headset.worn)
  },
  led({ devices }) { pilot.follow(devices) },
  answer(answer) {
    if (answer.error) said(`page: ${answer.to || "message"}`, answer.error)
    else if (answer.path) share(answer)
    if (!headset.owns(answer.device)) pilot.answered(answer)
    forks.answered(answer)
    start.answered(answer)
  },
  trouble({ text }) { said("page", text) },
}, shown)
let lastTime = 0, framed = null
const head = new Head(link)
const feel = new Feel()
const pilot = new Pilot($("lead"), link, feel)
const headset = new Headset($("headset"), link, feel, { scene: () => scene, eyes: () => eyes.all, frames: takeFrames,
  said: (text) => said("headset", text) })
const log = new Log($("lines"), $("worst"), (time) => { timeline.pause(); timeline.go(time) })
const eyes = new Eyes($("eyes"), $("pictures-row"), $("stereo"),
  () => said("pictures", "a picture cannot be read"))
const alerts = new Alerts($("alerts")), depths = new Depths($("depth-list"))
const network = new Network($("network"), $("links"), link)
const tune = new Tune($("tune"), $("tune-list"), link, (light) => { if (scene) scene.brightness = light; dirty = true })
const notices = new Notices($("notice"), (text) => guide.read(text))
let past = false // no samples for the plots: an instant of a recording, or of the running session's past
const timeline = new Timeline((time) => {
  if (time != null) lastTime = time
  if (past !== (time != null)) { past = time != null; ask() }
  link.send({ do: "at", time })
  plots.at(time)
  comparison?.at(time)
  log.at(time)
  dirty = true
})
const comparison = compared == null ? null
  : new Comparison($("compare"), timeline, () => { dirty = true }, (text) => said(compared, text))
const capture = new Capture($("view").querySelector(".tools"), timeline,
  () => ({ session: $("session").textContent, time: (timeline.past ? timeline.time : lastTime) ?? 0, framed }))
const started = new Started(link, [...document.querySelectorAll(".started")])
const forks = new Forks(link, timeline, started), start = new Start(link, started)
const recordings = new Recordings()
timeline.found = (events) => log.add(events, true)
const guide = new Guide($("guide"), link, eyes, () => past)
const plots = new Plots($("plot-list"), $("add"), $("ports"), ask, comparison?.other)
foldable($("eyes"), $("plots"), $("log"))
$("pictures").onchange = ask
$("frames").onchange = () => scene?.frames($("frames").checked)

// `led`: participants for pages to lead: the panel says how each follows, so their warnings stand in the log alone.
function warn(entries = [], led = new Set()) {
  log.add(entries)
  alerts.leave(led) // a device may be offered to pages only after its first warning
  alerts.add(entries.filter(({ source }) => !led.has(source)))
}

function said(source, text) { warn([{ time: lastTime ?? 0, level: "warn", source, text }]) }

function ask(again = false) {
  link.send({ do: "show", numbers: past ? [] : plots.names, pictures: $("pictures").checked, again: again === true })
}

async function begin(described) {
  session = described
  head.begin(described)
  past = described.kind === "recording"
  if (!past) timeline.reset()
  guide.begin(described)
  forks.begin(described)
  start.begin(described)
  recordings.begin(described)
  log.clear()
  alerts.clear()
  for (const text of described.notes ?? []) said("scene", text)
  if (!described.numbers) return
  notices.clear()
  plots.begin(described.numbers, described.kind === "recording")
  depths.begin(described.bonds, described.kind === "recording")
  await stage(described)
  const missing = described.kind === "recording" && !described.pictures.length && scene?.cameras.length
  eyes.begin(missing ? ["left", "right"] : described.pictures, Boolean(missing))
  ask(true)
  if (timeline.begun && !timeline.live) timeline.go(timeline.time)
}

// Which tip can be dragged, or why none can.
function sayDragged({ kind, role, dragged = [], undragged = [] }) {
  $("undragged").hidden = kind === "recording" || role === "viewer"
  $("undragged").textContent = dragged.length
    ? dragged.map(({ device, arm, turns }) => `Lead ${device}, and drag the arrows on the tip of ${arm}${turns ? ", or turn its rings" : ""}.`).join(" ")
    : `No tip can be dragged: ${undragged.join("; ")}.`
}

async function stage(described) {
  if (!scene && !refused) await makeScene()
  if (!scene) return
  const answer = await fetch(pathTo("/scene"))
  if (!answer.ok) return
  scene.load(await answer.arrayBuffer(), described.surfaces)
  scene.room = described.room
  tree.begin(scene, described.surfaces)
  sayDragged(described)
  scene.frames($("frames").checked)
  comparison?.stage(scene)
  const empty = described.scenes.length + described.surfaces.length === 0
  $("no-scene").hidden = !empty
  $("no-scene").textContent = empty ? "Nothing in this session has a scene to draw." : ""
  showCameras()
  dirty = true
  quality.begin(scene).catch((error) => said("scene", `textures: ${error.message}`))
}

let tree = null, quality = null
let refused = false // the browser has no WebGL
async function makeScene() {
  try {
    const { Scene } = await import("./scene.js")
    scene = new Scene($("canvas"), () => { dirty = true })
    scene.chosen = showCameras
    capture.begin(scene)
    const { Quality } = await import("./quality.js")
    quality = scene.quality = new Quality($("view").querySelector(".tools"), () => { dirty = eyesDue = true })
    scene.brightness = tune.light
    const [{ Gizmo }, { Tree }] = await Promise.all([import("./gizmo.js"), import("./tree.js")])
    tree = new Tree($("bodies"))
    pilot.gizmo = new Gizmo(scene)
    pilot.gizmo.moved = () => pilot.send()
    scene.before = () => pilot.gizmo.place()
  } catch (error) {
    refused = true
    $("no-scene").hidden = false
    $("no-scene").textContent =
      `This browser draws no scene (${error.message}). Plots and pictures work; to mend it, switch on WebGL.`
  }
}

function showCameras() { $("cameras").replaceChildren(...cameraButtons(scene)) }

function apply(frame) {
  lastTime = framed = frame.time
  for (const { kind, index, at, size } of frame.sections) {
    if (kind === SAMPLE) plots.sample(plots.names[index], new Float64Array(frame.buffer, at, size / 8))
    else if (kind === PICTURE) eyes.take(index, new Uint8Array(frame.buffer, at, size))
    else if (kind === ARROWS) {
      const rows = new Float32Array(frame.buffer, at, size / 4)
      scene?.arrows(index, rows)
      if (!past || session.kind === "recording") depths.take(index, rows)
    } else if (kind === FELT) feel.take(session.felt[index], new Float32Array(frame.buffer, at, 1)[0])
    else if (kind === MARKERS) {
      const markers = notices.take(index, markersOf(frame.buffer, at))
      scene?.marked(index, markers)
    } else if (!scene) continue
    else if (kind === POSES) scene.poses(index, frame.buffer, at, size)
    else if (kind === SURFACE) scene.surface(index, new Uint32Array(frame.buffer, at, size / 4))
    else if (kind === CHANGE) scene.change(index, changeOf(frame.buffer, at, size))
    else if (kind === FILM) scene.film(index, filmOf(frame.buffer, at, size))
    else if (kind === SMOKE) scene.smokes(index, new Float32Array(frame.buffer, at, 1)[0], frame.time)
    else if (kind === NODES) size && scene.nodes(index, nodesOf(frame.buffer, at, size))
  }
}

function share({ path, role }) {
  const url = `${location.origin}${path}`
  navigator.clipboard?.writeText(url).catch(() => {})
  log.add([{ time: lastTime, level: "info", source: `link for a ${role}, once`, text: url }])
  $("lines").scrollTop = $("lines").scrollHeight
}

// A headset draws in frames of its own; those of the window may stand still meanwhile.
function takeFrames() {
  const frames = waiting
  waiting = []
  for (const frame of frames) apply(frame)
  if (frames.length) { link.acknowledge(frames.at(-1).number); counted += frames.length; eyesDue = true }
}

function lookThroughEyes() {
  if (scene && $("pictures").checked) eyes.look((side, canvas) => scene.look(side, canvas))
}

let counted = 0, since = performance.now(), last = since, drawnAt = since, drawing = false, eyesDue = false
function draw(now) {
  requestAnimationFrame(draw)
  timeline.tick(now)
  if (!headset.worn) takeFrames()
  if (dirty && !headset.worn) {
    dirty = false
    if (drawing) scene?.pace(now - last, capture.coarsest)
    else scene?.resume(capture.coarsest)
    if (eyesDue) lookThroughEyes()
    eyesDue = false
    scene?.draw()
    capture.take()
    drawn++
    drawing = true
    drawnAt = now
  } else if (!headset.worn) {
    drawing = false
    if (now - drawnAt > STILL_MS && !capture.recorder) scene?.settle(session?.kind !== "recording", lookThroughEyes)
  }
  last = now
  capture.tick(now)
  if (now - refreshed > REFRESH_MS) { refreshed = now; plots.refresh(); depths.refresh(); tree?.refresh() }
  if (now - since > 1000) {
    $("fps").textContent = String(Math.round((counted * 1000) / (now - since)))
    counted = 0
    since = now
  }
}
requestAnimationFrame(draw)

// For the tests and the benchmark: what this page has drawn.
Object.defineProperty(window, "trocar", { value: { get drawn() { return drawn }, get time() { return lastTime },
  get framed() { return framed }, get scene() { return scene }, get headset() { return headset }, get session() { return session }, comparison } })
