"""Pictures of a scene: the stereo endoscope, and `trocar render` for recordings."""
