"""`trocar recording export`: a recording as a session of dvrk_data, the recorder of the dVRK."""
