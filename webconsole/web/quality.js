// How much the page draws: a choice of the person, or what this machine manages, found by the time a picture takes.

import { LEVELS } from "./looks.js"
import { make } from "./started.js"

const FLUENT_MS = 40 // a picture that takes longer is drawn with less
const CLIMB = 3 // a level takes so many times the one below, about
const STILL_MS = 800 // a picture of what stands still may take as long
const WARM_UP = 4, SLOW_FRAMES = 12 // pictures after a change that do not count, and slow ones in a row that do
const TRIES = 25, PAUSE_MS = 200 // for all surfaces to come
const KEY = "trocar-looks"

export class Quality {
  // `place`: for the menu; `dirty`: is called when another picture is to be drawn.
  constructor(place, dirty) {
    this.dirty = dirty
    this.trials = {} // ms of a picture, by level
    this.found = "plain"
    this.slow = this.drawn = this.turn = 0
    this.menu = make("select", { id: "looks", ariaLabel: "Looks of the scene", hidden: true,
      title: "full: textures, bumps, wet coats, shadows; simple: textures; plain: one colour for each body. auto: as much as this machine draws fluently",
      onchange: () => this.choose(this.menu.value) })
    this.menu.append(...["auto", ...LEVELS].map((value) => make("option", { value, textContent: value })))
    this.menu.value = this.choice = recall()
    place.append(this.menu)
  }

  // A scene has been loaded.
  async begin(scene) {
    const turn = ++this.turn
    Object.assign(this, { scene, dressed: null, trials: {}, found: "plain" })
    for (let tries = 0; tries < TRIES && !scene.surfaces.every(({ mesh }) => mesh); tries++) await pause()
    if (turn === this.turn) await this.apply()
  }

  async apply() {
    const turn = this.turn
    this.menu.hidden = false
    if (this.choice === "auto" && !this.trials.plain) await this.find()
    if (this.wanted !== "plain") await this.dress()
    if (turn !== this.turn) return
    this.scene.level = this.level
    this.menu.options[0].textContent = this.choice === "auto" ? `auto: ${this.found}` : "auto"
    this.dirty()
  }

  // Load the textures, once; without any the scene stays plain.
  async dress() {
    this.dressed ??= await this.scene.dress()
    this.menu.disabled = !this.dressed
    return this.dressed
  }

  // The level of what moves.
  get level() { return this.dressed ? this.wanted : "plain" }

  get wanted() { return this.choice === "auto" ? this.found : this.choice }

  // The level of what stands still.
  get still() {
    if (this.choice !== "auto" || !this.dressed) return this.level
    return LEVELS.find((level) => this.trials[level] < STILL_MS) ?? this.found
  }

  choose(value) {
    this.choice = value
    if (value === "auto") Object.assign(this, { trials: {}, found: "plain" })
    try { localStorage.setItem(KEY, value) } catch { /* this browser keeps nothing */ }
    this.slow = this.drawn = 0
    return this.apply()
  }

  // Climb as long as pictures are fluent: without a GPU a level takes several times the one below, and its shaders seconds.
  async find() {
    const { turn } = this
    for (const level of [...LEVELS].reverse()) {
      if (level !== "plain" && (!await this.dress() || turn !== this.turn)) return
      this.scene.trial(level) // shaders are compiled
      this.trials[level] = Math.min(this.scene.trial(level), this.scene.trial(level))
      if (this.trials[level] < FLUENT_MS) this.found = level
      if (this.trials[level] * CLIMB > FLUENT_MS) return
    }
  }

  // `interval`: ms since the picture before. Returns whether less is drawn from now on.
  pace(interval) {
    if (this.choice !== "auto" || this.found === "plain" || ++this.drawn < WARM_UP) return false
    this.slow = interval > FLUENT_MS ? this.slow + 1 : 0
    if (this.slow < SLOW_FRAMES) return false
    this.found = LEVELS[LEVELS.indexOf(this.found) + 1]
    this.slow = this.drawn = 0
    this.apply()
    return true
  }
}

function pause() { return new Promise((resolve) => setTimeout(resolve, PAUSE_MS)) }

function recall() {
  try {
    const kept = localStorage.getItem(KEY)
    return LEVELS.includes(kept) ? kept : "auto"
  } catch { return "auto" }
}
