// The pictures of the endoscope: side by side, or both eyes' in one for glasses of red (left) and cyan (right).

import { enlargeable } from "./enlarge.js"

const SIDES = ["left", "right"], GLASSES = ["#f00", "#0ff"]

// The picture of each eye, of those that have been drawn; null if there is no pair.
export function pairOf(eyes) {
  const pair = SIDES.map((side) => eyes.find(({ name, drawn }) => drawn && name.includes(side)))
  return pair.every(Boolean) ? pair : null
}

export class Eyes {
  // `unreadable` is called for a picture that cannot be read.
  constructor(section, row, mode, unreadable) {
    Object.assign(this, { section, row, mode, unreadable })
    this.all = []
    this.glass = document.createElement("canvas") // what one eye sees through its glass
    mode.onchange = () => this.show()
  }

  // `drawn`: none were published, and the page draws them itself, of the scene.
  begin(names, drawn = false) {
    this.drawn = drawn
    this.section.hidden = !names.length
    this.all = names.map((name) => ({ name, ...figure(drawn ? `${name} eye, drawn by this page` : name.replace("/image_raw/compressed", "")), drawn: 0 }))
    for (const eye of drawn ? [] : this.all) {
      eye.canvas.onclick = (event) => this.pick(eye, event)
      this.blank(eye)
    }
    this.both = figure("both eyes, for red and cyan glasses")
    const picks = () => Boolean(this.picking)
    for (const eye of [...this.all, this.both]) enlargeable(eye.figure, picks)
    this.row.replaceChildren(...this.all.map((eye) => eye.figure), this.both.figure)
    this.mode.hidden = !SIDES.every((side) => names.some((name) => name.includes(side)))
    this.show()
  }

  // A click in a picture, in its pixels.
  pick({ name, canvas, drawn }, event) {
    const { left, top, width, height } = canvas.getBoundingClientRect()
    if (drawn) this.clicked?.(name, (event.clientX - left) / width * canvas.width, (event.clientY - top) / height * canvas.height)
  }

  show() {
    const both = !this.mode.hidden && this.mode.value === "anaglyph"
    for (const eye of this.all) eye.figure.hidden = both
    this.both.figure.hidden = !both
    this.combine()
  }

  // Say that there is no picture at this instant.
  blank(eye) {
    eye.drawn = 0
    eye.canvas.getContext("2d").clearRect(0, 0, eye.canvas.width, eye.canvas.height)
    eye.caption.textContent = `${eye.text}: no picture yet`
  }

  async take(index, bytes) {
    const eye = this.all[index]
    if (!eye || eye.busy) { if (eye) eye.next = bytes; return }
    if (!bytes.byteLength) { this.blank(eye); return }
    eye.busy = true
    try {
      const picture = await createImageBitmap(new Blob([bytes]))
      Object.assign(eye.canvas, { width: picture.width, height: picture.height })
      eye.canvas.getContext("2d").drawImage(picture, 0, 0)
      picture.close()
      eye.caption.textContent = eye.text
      eye.drawn++
      if (!this.both.figure.hidden) this.waiting ??= requestAnimationFrame(() => this.combine())
    } catch { this.unreadable() }
    eye.busy = false
    const next = eye.next
    eye.next = null
    if (next) this.take(index, next)
  }

  // Draw the pictures that were not published; `look` draws one onto a canvas.
  look(look) {
    if (!this.drawn || this.section.hidden) return
    for (const eye of this.all) {
      look(eye.name, eye.canvas)
      eye.drawn++
    }
    this.combine()
  }

  // Red of the left picture, green and blue of the right one.
  combine() {
    this.waiting = null
    const pair = this.both.figure.hidden ? null : pairOf(this.all)
    if (!pair) return
    const { canvas } = this.both, { width, height } = pair[0].canvas
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height })
    Object.assign(this.glass, { width, height })
    const onto = canvas.getContext("2d"), glass = this.glass.getContext("2d")
    onto.clearRect(0, 0, width, height)
    onto.globalCompositeOperation = "lighter"
    pair.forEach((eye, i) => {
      glass.globalCompositeOperation = "copy"
      glass.drawImage(eye.canvas, 0, 0, width, height)
      glass.globalCompositeOperation = "multiply"
      glass.fillStyle = GLASSES[i]
      glass.fillRect(0, 0, width, height)
      onto.drawImage(this.glass, 0, 0)
    })
  }
}

function figure(text) {
  const figure = document.createElement("figure"), canvas = document.createElement("canvas")
  const caption = document.createElement("figcaption")
  caption.textContent = text
  canvas.setAttribute("role", "img")
  canvas.setAttribute("aria-label", `Picture of ${text}`)
  figure.append(canvas, caption)
  return { figure, canvas, caption, text }
}
