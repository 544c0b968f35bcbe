// Markers of augmented reality as they arrive (webconsole/markers.py), and the words among them that stay before the
// eyes of whoever looks through the endoscope: they stand on the page, whichever camera it has.

export const TEXT = 9 // visualization_msgs/Marker

export function markersOf(buffer, start) {
  const size = new DataView(buffer).getUint32(start, true)
  const rows = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, start + 4, size)))
  let at = start + 4 + size
  const take = (count, width) => {
    const numbers = new Float32Array(buffer, at, count * width)
    at += numbers.byteLength
    return numbers
  }
  const sum = (name) => rows.reduce((total, row) => total + row[name], 0)
  const poses = take(rows.length, 7), sizes = take(rows.length, 3), colours = take(rows.length, 4)
  const points = take(sum("points"), 3), ofPoints = take(sum("colours"), 4)
  let point = 0, coloured = 0
  return rows.map((row, i) => ({
    type: row.type, frame: row.frame, text: row.text, pose: poses.subarray(7 * i, 7 * i + 7),
    size: sizes.subarray(3 * i, 3 * i + 3), colour: colours.subarray(4 * i, 4 * i + 4),
    points: points.subarray(3 * point, 3 * (point += row.points)),
    colours: ofPoints.subarray(4 * coloured, 4 * (coloured += row.colours)),
  }))
}

export class Notices {
  // `changed`: is called with the new words.
  constructor(line, changed) {
    Object.assign(this, { line, changed })
    this.clear()
  }

  clear() {
    this.texts = []
    this.show()
  }

  // Show the words of these markers that a camera carries, and return the other markers.
  take(index, markers) {
    const carried = ({ type, frame }) => type === TEXT && frame.endsWith("_optical")
    this.texts[index] = markers.filter(carried).map(({ text }) => text)
    this.show()
    return markers.filter((one) => !carried(one))
  }

  show() {
    const text = this.texts.flat().join("\n")
    if (this.line.textContent !== text) {
      this.line.textContent = text
      this.changed(text)
    }
    this.line.hidden = !text
  }
}
