"""Visual servoing: the endoscope moves itself until four blobs are where they should be in its picture."""
