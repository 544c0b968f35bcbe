// Pictures and films of the scene as the page shows it: whichever camera, with ghost, forces and what is hidden.

import { make } from "./started.js"

const FILM_PER_S = 30, BITS_PER_S = 16e6
const PATIENCE_MS = 500 // for the picture of the last instant: none comes where nothing has changed
// MediaRecorder forgets pictures that are not encoded when it is stopped, and takes none while too many wait.
const PART_MS = 100 // period at which it hands over what is encoded, if anything
const WAITING_MS = 300, ENCODING_MS = 1000 // after so long without a part it takes pictures again; has encoded all
const KINDS = ["video/mp4;codecs=avc1.640028", "video/webm;codecs=vp9", "video/webm", "video/mp4"]

export class Capture {
  // `page`: the name of the session, the time that is shown (s), and that of the last frame (s).
  constructor(place, timeline, page) {
    Object.assign(this, { timeline, page })
    this.kind = globalThis.MediaRecorder && KINDS.find((kind) => MediaRecorder.isTypeSupported(kind))
    this.picture = make("button", { textContent: "Picture", title: "Save the scene as it is, with its time in the name (PNG)",
      onclick: () => this.still() })
    this.button = make("button", { textContent: "Film", title: "Film the scene, from now until it is pressed again",
      hidden: !this.kind, onclick: () => this.recorder ? this.stop() : this.start() })
    this.place = make("div", { className: "segments", hidden: true }, this.picture, this.button)
    place.append(this.place)
  }

  // The least pixel ratio to draw with: on a slow machine a film has fewer pictures rather than coarse ones.
  get coarsest() { return this.recorder ? 1 : 0.5 }

  begin(scene) {
    this.scene = scene
    this.place.hidden = false
  }

  still() {
    const { renderer, canvas } = this.scene, ratio = renderer.getPixelRatio()
    renderer.setPixelRatio(devicePixelRatio)
    this.scene.draw()
    const name = `${this.name(this.page().time)}.png`
    canvas.toBlob((content) => save(content, name))
    renderer.setPixelRatio(ratio)
    this.scene.dirty()
  }

  name(...times) { return [this.page().session, ...times.map((time) => `${time.toFixed(3)}s`)].join("-") }

  // Of a recording the film plays it, from the instant that is shown to the end.
  start() {
    const ratio = Math.min(devicePixelRatio, 2), { clientWidth, clientHeight } = this.scene.canvas
    const even = (length) => 2 * Math.round((length * ratio) / 2)
    this.film = make("canvas", { width: even(clientWidth), height: even(clientHeight) })
    this.letters = 15 * ratio
    this.onto = this.film.getContext("2d")
    this.recorder = new MediaRecorder(this.film.captureStream(FILM_PER_S), { mimeType: this.kind, videoBitsPerSecond: BITS_PER_S })
    const parts = [], from = this.page().time, { stream } = this.recorder
    this.recorder.ondataavailable = ({ data }) => {
      parts.push(data)
      this.encodedAt = performance.now()
    }
    this.recorder.onstop = () => {
      for (const track of stream.getTracks()) track.stop() // not before: pictures are still being encoded
      const kind = this.kind.split(";")[0]
      save(new Blob(parts, { type: kind }), `${this.name(from, this.ended)}.${kind.split("/")[1]}`)
    }
    this.plays = this.timeline.past && !this.timeline.playing
    if (this.plays) this.timeline.play()
    this.scene.draw()
    this.take()
    this.recorder.start(PART_MS)
    this.button.textContent = "End film"
    this.button.setAttribute("aria-pressed", "true")
  }

  // The scene has just been drawn: a moment later its canvas is empty.
  take() {
    if (!this.recorder) return
    const { width, height } = this.film, edge = this.letters
    this.onto.drawImage(this.scene.canvas, 0, 0, width, height)
    Object.assign(this.onto, { font: `600 ${this.letters}px system-ui`, fillStyle: "#fff", strokeStyle: "#0009",
      lineWidth: this.letters / 5, lineJoin: "round" })
    const { session, time } = this.page()
    for (const [text, align, x] of [[session, "left", edge], [`${time.toFixed(2)} s`, "right", width - edge]]) {
      this.onto.textAlign = align
      this.onto.strokeText(text, x, height - edge)
      this.onto.fillText(text, x, height - edge)
    }
  }

  // Called at each drawing of the page: the end of the recording is the end of its film.
  tick(now) {
    if (!this.recorder || !this.plays) return
    if (this.timeline.playing) this.playedAt = now
    else if (this.page().framed >= this.timeline.time || now - this.playedAt > PATIENCE_MS) this.stop()
  }

  stop() {
    if (this.plays && this.timeline.playing) this.timeline.pause()
    const { recorder } = this
    this.ended = this.page().time
    this.recorder = null
    this.button.disabled = true
    this.button.textContent = "Film"
    this.button.setAttribute("aria-pressed", "false")
    this.finish(recorder)
  }

  // The last picture comes twice: on a slow machine the first time may have been one too many.
  async finish(recorder) {
    await this.encoderIdle(WAITING_MS)
    this.onto.drawImage(this.film, 0, 0)
    await this.encoderIdle(ENCODING_MS)
    recorder.stop()
    this.button.disabled = false
  }

  // Wait until nothing has been encoded for so long (ms).
  async encoderIdle(duration) {
    this.encodedAt = performance.now()
    while (performance.now() - this.encodedAt < duration) await new Promise((done) => setTimeout(done, PART_MS))
  }
}

function save(content, name) {
  const link = make("a", { href: URL.createObjectURL(content), download: name })
  link.click()
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000)
}
