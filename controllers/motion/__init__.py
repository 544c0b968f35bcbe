"""The motion controller of the patient cart's arms: CRTK's commands in, setpoints for the drives out."""
