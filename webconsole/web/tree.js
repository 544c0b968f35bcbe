// The bodies and soft surfaces of the scene: shown or hidden, followed by the camera, and where one is.
//
// Keys in the tree: up and down go from line to line, left and right close and open, space shows or hides, F follows,
// Enter chooses the line whose pose is told.

import * as THREE from "./vendor/three.module.js"
import { make } from "./started.js"

const WORLD = "world"

export class Tree {
  constructor(element, link) {
    Object.assign(this, { element, scene: null, chosen: null })
    this.filter = make("input", { type: "search", placeholder: "filter by name", autocomplete: "off", oninput: () => this.sift() })
    this.filter.setAttribute("aria-label", "Filter the bodies by name")
    this.list = make("div", { className: "tree", onkeydown: (event) => this.key(event) })
    this.list.setAttribute("role", "tree")
    this.list.setAttribute("aria-label", "Bodies")
    this.frame = make("select", { onchange: () => this.refresh() })
    this.frame.setAttribute("aria-label", "Frame of the pose")
    this.follow = make("button", { type: "button", textContent: "Follow", title: "The camera goes with it (F)", onclick: () => this.toggleFollow() })
    this.told = make("output", { className: "pose" })
    this.panel = make("div", { hidden: true }, make("div", { className: "row" }, make("strong"), " in ", this.frame, this.follow), this.told)
    element.append(this.filter, this.list, this.panel)
  }

  // `scene`: loaded; `surfaces`: described.
  begin(scene, surfaces) {
    this.scene = scene
    this.choose(null)
    scene.follow(null)
    const groups = new Map()
    const put = (head, item) => groups.set(head, [...(groups.get(head) ?? []), item])
    for (const { participant, names, groups: bodies } of scene.parts) {
      names.forEach((name, i) => {
        if (!bodies[i].children.some((one) => one.isMesh)) return
        const arm = name.split("/")[0]
        put(names.some((one) => one.startsWith(`${arm}/`)) ? arm : participant, { name, object: bodies[i] })
      })
    }
    surfaces.forEach(({ name }, i) => put("soft", { name: name.replace(/\/nodes$/, ""), surface: scene.surfaces[i] }))
    this.branches = [...groups].map(([name, items]) => this.branch(name, items))
    this.list.replaceChildren(...this.branches.map(({ element }) => element))
    this.frames = new Map([[WORLD, null], ...[...scene.places].filter(([name]) => !name.startsWith("_"))])
    this.frame.replaceChildren(...[...this.frames.keys()].map((name) => new Option(name, name)))
    this.element.hidden = !this.branches.length
    this.sift()
  }

  branch(name, items) {
    const line = this.line(name, (shown) => { for (const one of lines) one.show(shown) })
    const lines = items.map((item) => {
      const made = this.line(item.name, (shown) => showItem(item, shown), item)
      made.element.setAttribute("aria-level", 2)
      return { ...made, item }
    })
    const group = make("div", {}, ...lines.map(({ element }) => element))
    group.setAttribute("role", "group")
    line.element.setAttribute("aria-expanded", "false")
    group.hidden = true
    line.name.onclick = () => this.expand(line.element, group.hidden)
    return { name, lines, line: line.element, group, element: make("div", {}, line.element, group) }
  }

  line(text, shown, item) {
    const box = make("input", { type: "checkbox", checked: true, tabIndex: -1, onchange: () => this.shown(shown, box.checked) })
    box.setAttribute("aria-label", `Show ${text}`)
    const name = make("span", { textContent: text, onclick: () => item && this.choose(item, element) })
    const element = make("div", { className: "line", tabIndex: -1 }, box, name)
    element.setAttribute("role", "treeitem")
    element.setAttribute("aria-label", text)
    Object.assign(element, { box, item, text })
    return { element, name, show: (value) => { box.checked = value; shown(value) } }
  }

  shown(show, value) { show(value); this.scene.dirty() }

  expand(line, open) {
    line.setAttribute("aria-expanded", String(open))
    line.nextElementSibling.hidden = !open
  }

  sift() {
    const wanted = this.filter.value.trim().toLowerCase()
    for (const { name, lines, line, group, element } of this.branches ?? []) {
      const whole = name.toLowerCase().includes(wanted)
      for (const one of lines) one.element.hidden = !whole && !one.item.name.toLowerCase().includes(wanted)
      element.hidden = lines.every((one) => one.element.hidden)
      if (wanted) this.expand(line, !element.hidden)
    }
    const lines = this.lines
    if (lines.length && !lines.some((one) => one.tabIndex === 0)) lines[0].tabIndex = 0
  }

  get lines() { return [...this.list.querySelectorAll(".line")].filter((one) => one.checkVisibility()) }

  key(event) {
    const line = event.target.closest(".line"), lines = this.lines, at = lines.indexOf(line)
    const parent = line?.hasAttribute("aria-expanded")
    const act = {
      ArrowDown: () => this.focus(lines[at + 1]), ArrowUp: () => this.focus(lines[at - 1]),
      ArrowRight: () => parent && this.expand(line, true), ArrowLeft: () => parent && this.expand(line, false),
      " ": () => line.box.click(), Enter: () => parent ? line.lastChild.click() : this.choose(line.item, line),
      f: () => { if (!parent) { this.choose(line.item, line); this.toggleFollow() } },
    }[event.key]
    if (!act || !line) return
    event.preventDefault()
    event.stopPropagation()
    act()
  }

  focus(line) {
    if (!line) return
    for (const one of this.list.querySelectorAll(".line")) one.tabIndex = -1
    line.tabIndex = 0
    line.focus()
  }

  choose(item, line) {
    for (const one of this.list.querySelectorAll("[aria-selected=true]")) one.setAttribute("aria-selected", "false")
    line?.setAttribute("aria-selected", "true")
    this.chosen = item
    this.panel.hidden = !item
    if (!item) return
    this.panel.querySelector("strong").textContent = item.name
    this.refresh()
  }

  toggleFollow() {
    this.scene.follow(this.scene.followed === this.chosen?.place ? null : this.place())
    this.refresh()
  }

  // What returns the place of the chosen item in the world (m), the same for the same item.
  place() {
    const { chosen } = this
    chosen.place ??= chosen.object ? () => chosen.object.getWorldPosition(new THREE.Vector3()) : () => middle(chosen.surface)
    return chosen.place
  }

  refresh() {
    if (!this.chosen || this.panel.hidden) return
    const held = this.scene.followed != null && this.scene.followed === this.chosen.place
    this.follow.setAttribute("aria-pressed", String(held))
    const frame = this.frames.get(this.frame.value), matrix = new THREE.Matrix4()
    this.scene.world.updateMatrixWorld()
    if (frame) matrix.copy(frame.matrixWorld).invert()
    const { object, surface } = this.chosen
    const pose = object ? matrix.multiply(object.matrixWorld) : null
    const text = pose ? poseText(pose) : `middle ${metres(middle(surface).applyMatrix4(matrix))}`
    if (this.told.textContent !== text) this.told.textContent = text
  }
}

function showItem({ object, surface }, shown) {
  if (surface) { if (surface.mesh) surface.mesh.visible = shown } else for (const one of object.children) if (one.isMesh) one.visible = shown
}

function middle({ mesh }) {
  if (!mesh) return new THREE.Vector3()
  mesh.geometry.computeBoundingBox()
  return mesh.geometry.boundingBox.getCenter(new THREE.Vector3())
}

function metres({ x, y, z }) { return `${[x, y, z].map((one) => one.toFixed(4)).join(", ")} m` }

// Position, rotation about the fixed axes x, y, z in this order, and quaternion.
function poseText(matrix) {
  const position = new THREE.Vector3(), turn = new THREE.Quaternion(), size = new THREE.Vector3()
  matrix.decompose(position, turn, size)
  const { x, y, z } = new THREE.Euler().setFromQuaternion(turn, "ZYX")
  const degrees = [x, y, z].map((one) => ((one * 180) / Math.PI).toFixed(1)).join(", ")
  const quaternion = turn.toArray().map((one) => one.toFixed(4)).join(", ")
  return `position ${metres(position)}\nroll, pitch, yaw ${degrees}°\nquaternion (x, y, z, w) ${quaternion}`
}
