// The WebSocket to the server: frames, states and answers in, commands and acknowledgements out.
// webconsole/frame.py has the layout of the frames.

import { pathTo } from "./address.js"

const MAGIC = 0x46435254 // "TRCF", little-endian
const HEAD = 24
export const POSES = 1, SURFACE = 2, NODES = 3, PICTURE = 4, SAMPLE = 5, ARROWS = 6, MARKERS = 7, FELT = 8, CHANGE = 9, FILM = 10, SMOKE = 11

export function parseFrame(buffer) {
  const view = new DataView(buffer)
  if (buffer.byteLength < HEAD || view.getUint32(0, true) !== MAGIC || view.getUint16(4, true) !== 3) return null
  const sections = []
  let at = HEAD
  for (let left = view.getUint16(6, true); left > 0; left--) {
    const kind = view.getUint16(at, true), index = view.getUint16(at + 2, true), size = view.getUint32(at + 4, true)
    sections.push({ kind, index, at: at + 8, size })
    at += 8 + size + ((8 - (size % 8)) % 8)
  }
  return { time: Number(view.getBigInt64(8, true)) / 1e9, number: view.getUint32(16, true), sections, buffer }
}

// Nodes of a surface: least and step (f32, 3 each), then the steps (u16) of all x, all y and all z.
export function nodesOf(buffer, at, size) {
  const head = new Float32Array(buffer, at, 6), steps = new Uint16Array(buffer, at + 24, (size - 24) / 2)
  const count = steps.length / 3, nodes = new Float32Array(steps.length)
  for (let axis = 0; axis < 3; axis++) {
    const low = head[axis], step = head[3 + axis], from = axis * count
    for (let i = 0; i < count; i++) nodes[3 * i + axis] = low + step * steps[from + i]
  }
  return nodes
}

// Changed faces of a surface: their slots (u32), their nodes (i32, 3 each; -1: gone), the first node at the resting
// place of each appended node (u32), and the kinds of the faces (u8).
export function changeOf(buffer, at, size) {
  const count = size && new Uint32Array(buffer, at, 1)[0], from = at + 4
  return { slots: new Uint32Array(buffer, from, count), faces: new Int32Array(buffer, from + 4 * count, 3 * count),
    origins: new Uint32Array(buffer, from + 16 * count, size && (size - 4 - 17 * count) / 4),
    kinds: new Uint8Array(buffer, at + size - count, count) }
}

// Liquid on a surface: deep colour and depths (f32, 3 each), wet nodes (u32), thickness at each (u8, 10 um).
export function filmOf(buffer, at, size) {
  const count = (size - 24) / 5
  return { tint: new Float32Array(buffer, at, 6), nodes: new Uint32Array(buffer, at + 24, count),
    thickness: new Uint8Array(buffer, at + 24 + 4 * count, count) }
}

const OTHER_SOURCE = 4001, NOT_SHOWN = 4002

export class Link {
  // `recording`: a name of /recordings; null: what the server was started for.
  constructor(handlers, recording) {
    Object.assign(this, { handlers, recording })
    this.ack = new Uint32Array(1)
    this.open()
  }

  open() {
    this.socket = new WebSocket(`${location.origin.replace(/^http/, "ws")}${pathTo("/page", {}, this.recording)}`) // https: wss
    this.socket.binaryType = "arraybuffer"
    this.socket.onopen = () => this.handlers.opened()
    this.socket.onmessage = ({ data }) => {
      if (typeof data !== "string") {
        const frame = parseFrame(data)
        if (frame) this.handlers.frame(frame)
        return
      }
      const message = JSON.parse(data)
      this.handlers[message.is]?.(message)
    }
    this.socket.onclose = ({ code, reason }) => {
      if (code === NOT_SHOWN) return this.handlers.refused(reason)
      if (code === OTHER_SOURCE) return location.reload() // another source: a recording after its session
      this.handlers.closed()
      this.look()
      setTimeout(() => this.open(), 1000)
    }
  }

  // A socket does not say why it was refused: another server, started since, knows no cookie of before.
  look() {
    fetch("/", { method: "HEAD", cache: "no-store" })
      .then(({ status }) => { if (status === 403) this.handlers.refused() })
      .catch(() => {}) // it does not answer, as the page says already
  }

  get ready() { return this.socket.readyState === WebSocket.OPEN }

  send(command) { if (this.ready) this.socket.send(JSON.stringify(command)) }

  acknowledge(number) {
    if (!this.ready) return
    this.ack[0] = number
    this.socket.send(this.ack)
  }
}
