"""The training scenes of the paper's section 4.1: boards with pegs and rings, dishes with pieces."""
