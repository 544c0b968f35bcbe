"""The cholecystectomy task: phases, clips, cuts, harm and errors of the operation, measured in the tissue."""
