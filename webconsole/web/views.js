// Cameras to choose from: directions, each tip, the endoscope, and the camera that the scenario puts into the room.

const UP = 1.55 // rad: straight down would leave open where the picture's top is

// Azimuth and elevation (rad) of each direction; z is up.
export const DIRECTIONS = {
  front: { turn: [-Math.PI / 2, 0], text: "along +y" },
  side: { turn: [0, 0], text: "along -x" },
  top: { turn: [-Math.PI / 2, UP], text: "down, y to the top" },
}

// Return how an orbit looks from a place at a target, both in m.
export function orbitFrom({ position, target }) {
  const [x, y, z] = position.map((one, i) => one - target[i]), distance = Math.hypot(x, y, z)
  return { target, distance, azimuth: Math.atan2(y, x), elevation: Math.asin(z / distance) }
}

// The buttons that choose one.
export function cameraButtons(scene) {
  return scene.choices.map((name) => {
    const button = document.createElement("button")
    button.textContent = name[0].toUpperCase() + name.slice(1)
    button.title = DIRECTIONS[name] ? `Look ${DIRECTIONS[name].text}` : name === "overview" ? "From the scenario's camera in the room" : ""
    button.setAttribute("role", "radio")
    button.setAttribute("aria-checked", String(scene.choice === name))
    button.onclick = () => scene.choose(name)
    return button
  })
}
