"""What surrounds a scene in pictures: an abdomen or a dry lab, and the materials of the robot. No physics."""
