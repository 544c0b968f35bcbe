// The force on the instrument, felt as vibration where the gamepad or the controller of a headset can.
//
// Vibration pushes no hand, so it needs no more care than to end: each pulse is short, and without a new force, or
// with the dead-man let go, there is no next one.

const FULL_N = 2 // felt with all strength, and so is more: the most that a stylus may give (docs/concepts/safety.md)
const LEAST_N = 0.02 // below it nothing touches (webconsole/recorded.py)
const WEAKEST = 0.1 // what most motors begin to turn with
const PULSE_MS = 100, PERIOD_MS = 50, SILENCE_MS = 150

export class Feel {
  constructor() {
    this.forces = new Map() // by device: { force (N), at (ms) }
    this.pulsed = new Map()
  }

  take(device, force) { this.forces.set(device, { force, at: performance.now() }) }

  // In N; 0 where nothing touches, or nothing is known any more.
  force(device) {
    const { force, at } = this.forces.get(device) ?? { force: 0, at: 0 }
    return force >= LEAST_N && performance.now() - at <= SILENCE_MS ? force : 0
  }

  // From 0 to 1.
  strength(device) {
    const force = this.force(device)
    return force && WEAKEST + (1 - WEAKEST) * Math.min(force / FULL_N, 1)
  }

  // Let the hand that leads a device feel it; `held`: whether its dead-man is.
  pulse(device, gamepad, held) {
    const actuator = gamepad?.vibrationActuator ?? gamepad?.hapticActuators?.[0], now = performance.now()
    if (!actuator || now - (this.pulsed.get(device) ?? -PERIOD_MS) < PERIOD_MS) return
    const strength = held ? this.strength(device) : 0
    if (!strength) return
    this.pulsed.set(device, now)
    const made = actuator.playEffect
      ? actuator.playEffect("dual-rumble", { duration: PULSE_MS, strongMagnitude: strength, weakMagnitude: strength })
      : actuator.pulse(strength, PULSE_MS)
    made?.catch?.(() => this.pulsed.set(device, Infinity)) // it cannot, and is not asked again
  }
}
