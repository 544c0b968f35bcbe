"""Force on a person's hand: contact rendered at the device's rate, and the limits of every force."""
