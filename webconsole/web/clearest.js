// From where the robot hides least of the work.

import { Raycaster, Vector3 } from "./vendor/three.module.js"

const TURNS = 12, POINTS = 3 // around the vertical, and along each side of the work's top
const PREFERENCE = 0.2 // share of the work that may be hidden more from where one usually looks than from behind
const MARGIN_M = 0.004 // above a point, within which nothing hides it: an instrument that touches it

// Return an azimuth, rad. `bodies` are objects of the robot; `box` is that of the work, from `distance` (m) away.
export function clearestAzimuth(bodies, box, { distance, elevation, usual }) {
  const meshes = []
  for (const body of bodies) if (body.visible) body.traverse((one) => one.isMesh && one.visible && meshes.push(one))
  const centre = box.getCenter(new Vector3()), points = pointsOn(box), ray = new Raycaster()
  let best = usual, least = Infinity
  for (let i = 0; i < TURNS; i++) {
    const azimuth = usual + (2 * Math.PI * i) / TURNS, level = distance * Math.cos(elevation)
    const eye = new Vector3(level * Math.cos(azimuth), level * Math.sin(azimuth), distance * Math.sin(elevation)).add(centre)
    const hidden = points.filter((point) => isHidden(ray, eye, point, meshes)).length / points.length
    const cost = hidden - PREFERENCE * 0.5 * (1 + Math.cos(azimuth - usual))
    if (cost < least - 1e-9) [best, least] = [azimuth, cost]
  }
  return best
}

function pointsOn({ min, max }) {
  const points = []
  for (let i = 0; i < POINTS; i++) {
    for (let j = 0; j < POINTS; j++) {
      const share = (k) => (k + 0.5) / POINTS
      points.push(new Vector3(min.x + share(i) * (max.x - min.x), min.y + share(j) * (max.y - min.y), max.z))
    }
  }
  return points
}

function isHidden(ray, eye, point, meshes) {
  const way = point.clone().sub(eye)
  ray.far = way.length() - MARGIN_M
  ray.set(eye, way.normalize())
  return meshes.some((mesh) => ray.intersectObject(mesh, false).length > 0)
}
